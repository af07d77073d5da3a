#include "tools/output/empty_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "render/automatic/first_choice.h"
#include "render/colour/function_parts.h"
#include "render/image/image.h"

namespace curvisplat {
namespace {

constexpr int kSamples = 4096;

std::string text(const glm::dvec3& point) {
  return fmt::format("({}, {}, {})", point.x, point.y, point.z);
}

/// The function's largest extinction on [low, high].
double largestExtinction(const TransferFunction& function, double low, double high) {
  double largest = 0;
  for (int n = 0; n <= kSamples; ++n)
    largest =
        std::max(largest, function.at(std::lerp(low, high, static_cast<double>(n) / kSamples)).extinction);
  return largest;
}

/// Why all of the scalar's values are transparent: the function itself, or its range.
std::string whyTransparent(const RenderedScene& scene) {
  const TransferFunction& function = scene.transfer_function;
  const auto [low, high] = function.range();
  if (largestExtinction(function, low, high) == 0)
    return fmt::format("the transfer function '{}' is fully transparent; choose another --tf or --opacity",
                       function.name());
  return fmt::format(
      "over the range {}..{}, the transfer function '{}' is fully transparent for all values of {} (found "
      "{}..{}); choose another --range",
      low, high, function.name(), scene.variable.name, scene.variable.min, scene.variable.max);
}

/// Why no splat reaches a pixel although the function and the camera allow it, from the counts of the frame.
std::string whyNothingIsVisible(const RenderedScene& scene) {
  const Manifest& manifest = scene.manifest;
  const FrameStatistics& s = scene.statistics;
  if (manifest.volume == 0)
    return fmt::format(
        "all {} splats are flat and have no volume, so they are invisible in volume rendering: the samples "
        "lie "
        "in one plane or line, or their neighbours are blanked ({} of {} samples are blanked)",
        manifest.splats, manifest.blanked_nodes, manifest.nodes);
  const bool by_gradient = !scene.options.gradient_opacity.empty();
  if (s.splats_transparent + s.bricks_transparent > 0 && s.splats_drawn == 0)
    return fmt::format(
        "the transfer function '{}'{} is transparent for all visible values of {}; move the camera, or "
        "choose "
        "another {}--range or --tf",
        scene.transfer_function.name(), by_gradient ? " times --gradient-opacity" : "", scene.variable.name,
        by_gradient ? "--gradient-opacity, " : "");
  if (manifest.blanked_nodes > 0 && s.splats_drawn == 0)
    return fmt::format(
        "the visible part of the data is blanked ({} of {} samples are); move the camera (--view iso), or "
        "convert again without --blank or iblank",
        manifest.blanked_nodes, manifest.nodes);
  if (s.splats_off_screen > 0 && s.splats_off_screen == s.splats_read)
    return fmt::format("all {} splats are off the screen; try --view iso, or a smaller --zoom",
                       s.splats_read);
  return fmt::format(
      "of {} splats read, {} are outside --clip-box or --clip-plane, {} off the screen, {} transparent, and "
      "{} were drawn "
      "but "
      "reach no pixel; try --view iso, another --range or another --clip-box",
      s.splats_read, s.splats_clipped, s.splats_off_screen, s.splats_transparent, s.splats_drawn);
}

/// The intersection of the data's box and the clip box, scaled; false if nothing of it is left by the box or by
/// a clip plane.
bool visibleBox(const RenderedScene& scene, glm::dvec3& lower, glm::dvec3& upper) {
  lower = scene.manifest.lower;
  upper = scene.manifest.upper;
  if (const auto& clip = scene.options.clip_box) {
    lower = glm::max(lower, clip->lower);
    upper = glm::min(upper, clip->upper);
  }
  for (int axis = 0; axis < 3; ++axis)
    if (lower[axis] > upper[axis]) return false;
  for (const ClipPlane& plane : scene.options.clip_planes) {
    const glm::dvec3 farthest(plane.normal.x > 0 ? upper.x : lower.x, plane.normal.y > 0 ? upper.y : lower.y,
                              plane.normal.z > 0 ? upper.z : lower.z);
    if (glm::dot(plane.normal, farthest - plane.point) < 0) return false;
  }
  lower *= scene.options.scale;
  upper *= scene.options.scale;
  return true;
}

/// Length of the box's diagonal in pixels, when it is perpendicular to the view direction.
double diagonalPixels(const RenderedScene& scene, const glm::dvec3& lower, const glm::dvec3& upper) {
  const Camera& camera = scene.camera;
  const double distance = glm::length(0.5 * (lower + upper) - camera.position);
  const double half_height = camera.projection == Projection::kPerspective
                                 ? distance * std::tan(camera.view_angle_deg * std::numbers::pi / 360)
                                 : camera.parallel_scale;
  return glm::length(upper - lower) / (2 * half_height) * scene.options.size.height;
}

/// Whether all corners of the box lie outside one plane of the view frustum.
bool outOfView(const RenderedScene& scene, const glm::dvec3& lower, const glm::dvec3& upper) {
  const Camera& camera = scene.camera;
  const glm::dmat4 view_from_world = camera.viewFromWorld();
  const double aspect = static_cast<double>(scene.options.size.width) / scene.options.size.height;
  const double slope = std::tan(camera.view_angle_deg * std::numbers::pi / 360);
  int beyond[5] = {};  // left, right, below, above, behind
  for (int n = 0; n < 8; ++n) {
    const glm::dvec4 world(n & 1 ? upper.x : lower.x, n & 2 ? upper.y : lower.y, n & 4 ? upper.z : lower.z,
                           1);
    const glm::dvec4 view = view_from_world * world;
    const bool perspective = camera.projection == Projection::kPerspective;
    const double half_height = perspective ? -view.z * slope : camera.parallel_scale;
    beyond[0] += view.x < -half_height * aspect;
    beyond[1] += view.x > half_height * aspect;
    beyond[2] += view.y < -half_height;
    beyond[3] += view.y > half_height;
    beyond[4] += perspective && view.z > 0;
  }
  return std::any_of(beyond, beyond + 5, [](int corners) { return corners == 8; });
}

}  // namespace

bool isEmpty(const Image& image, const glm::vec4& background) {
  constexpr float kMinSeen = 1.0f / 512;  // half a step of an 8-bit display
  for (size_t n = 0; n < image.rgba.size(); ++n)
    if (!(std::abs(image.rgba[n] - background[static_cast<int>(n % 4)]) < kMinSeen)) return false;
  return true;
}

/// Names the options that leave nothing of the data; empty if they leave some.
std::string whyAllIsClipped(const RenderedScene& scene) {
  glm::dvec3 lower, upper;
  if (visibleBox(scene, lower, upper)) return {};
  return fmt::format(
      "{} none of the data, which spans {} to {}",
      scene.options.clip_planes.empty() ? "--clip-box contains" : "--clip-plane and --clip-box leave",
      text(scene.manifest.lower), text(scene.manifest.upper));
}

/// Why nothing is seen of a scene without the volume.
std::string whyNoSheetIsVisible(const SurfaceScene& sheets, const RenderedScene& scene) {
  const bool is_only_iso = sheets.surfaces.empty() && sheets.grid_surfaces.empty() && sheets.slices.empty() &&
                           sheets.curves.empty() && sheets.hasIsosurfaces();
  if (!is_only_iso)
    return "no surface, slice, line or isosurface is in sight, and --volume is off; try --view iso or "
           "another camera";
  if (const std::string clipped = whyAllIsClipped(scene); !clipped.empty()) return clipped;
  std::vector<std::string> asked;
  const auto ask = [&](const std::vector<double>& values, const VariableInfo& of) {
    if (!values.empty())
      asked.push_back(fmt::format("{:g} of {}, which goes from {:g} to {:g}", fmt::join(values, ", "),
                                  of.name, of.min, of.max));
  };
  ask(sheets.isovalues, scene.variable);
  for (const FurtherIsosurfaces& further : sheets.further_isosurfaces)
    ask(further.values, scene.manifest.variables[further.variable]);
  return fmt::format(
      "no isosurface is in sight, and --volume is off; asked for {}. A cache has the means over cells, which "
      "are less far apart: try a value between, --view iso, or convert again with --refine 2",
      fmt::join(asked, "; "));
}

std::vector<std::string> whyEmpty(const RenderedScene& scene) {
  std::vector<std::string> reasons;
  if (scene.options.scene && !scene.options.scene->volume)
    return {whyNoSheetIsVisible(*scene.options.scene, scene)};
  const double largest = largestExtinction(scene.transfer_function, scene.variable.min, scene.variable.max);
  if (largest == 0) reasons.push_back(whyTransparent(scene));

  glm::dvec3 lower, upper;
  if (!visibleBox(scene, lower, upper)) {
    reasons.push_back(whyAllIsClipped(scene));
  } else {
    const bool out_of_view = outOfView(scene, lower, upper);
    if (out_of_view)
      reasons.push_back(fmt::format("the camera at {} looking at {} does not see the data's box {} to {}",
                                    text(scene.camera.position), text(scene.camera.focal_point), text(lower),
                                    text(upper)));
    const double pixels = diagonalPixels(scene, lower, upper);
    if (!out_of_view && scene.manifest.volume > 0 && pixels < 1)
      reasons.push_back(fmt::format(
          "the visible data is only {:.2g} pixels large; move the camera closer or choose a smaller {}",
          pixels, scene.camera.projection == Projection::kPerspective ? "--view-angle" : "--parallel-scale"));
    const double thickest = largest * glm::length(upper - lower);
    if (thickest > 0 && thickest < 0.01)
      reasons.push_back(fmt::format(
          "the data is nearly transparent: its optical depth is at most {:.2g}; choose an --opacity-unit "
          "smaller than {}",
          thickest, scene.transfer_function.opacityUnit()));
  }
  if (reasons.empty()) reasons.push_back(whyNothingIsVisible(scene));
  return reasons;
}

/// The options that show the layers of data which is thin in z, or on a sphere; empty if it is neither, or stretched already.
std::string stretchingFor(const RenderedScene& scene) {
  constexpr double kThin = 0.1, kStretched = 0.25;  // of the larger width
  const auto& globe = scene.manifest.globe;
  if (scene.options.scale.z != 1) return {};
  if (globe && globe->sphere()) return globe->vertical_scale == 1 ? "convert with --vertical-scale 50" : "";
  const glm::dvec3 extent = scene.manifest.upper - scene.manifest.lower;
  const double width = std::max(extent.x, extent.y);
  if (!(extent.z > 0 && extent.z < kThin * width)) return {};
  const double factor = kStretched * width / extent.z * (globe ? std::abs(globe->vertical_scale) : 1);
  return fmt::format("draw it with --view iso --vertical-scale {:g}", roundedTo(factor, factor, 1));
}

std::string poorPictureWarning(const Image& image, const RenderedScene& scene,
                               const std::string& function_options) {
  // Parts of the picture; of what is seen. A vortex above a flat sea may be a twentieth of what is seen.
  constexpr double kMinSeen = 0.005, kMinOther = 0.04;
  // Surfaces and slices have a colour of their own, which no option for the volume changes.
  if (scene.options.scene && !scene.options.scene->empty()) return {};
  const PictureContrast contrast = contrastOf(image, scene.options.background);
  const bool blank = contrast.seen < kMinSeen;
  if (!blank && (contrast.other >= kMinOther * contrast.seen || isNearlyConstant(scene.variable))) return {};
  const std::string what =
      blank ? fmt::format("nearly blank: {:.2g} % of its pixels differ visibly from the background",
                          100 * contrast.seen)
            : "of one colour";
  if (!blank && scene.options.light && scene.options.light->hasShadows())
    return "the picture is dark or of one colour: the volume shadows itself; lower --shadow and "
           "--ambient-occlusion, or choose a larger --opacity-unit";
  if (!function_options.empty())
    return fmt::format("the picture is {}; leave out {} to have colours and opacities chosen from the data{}",
                       what, function_options, blank ? ", or look from elsewhere (--view iso)" : "");
  if (blank)
    return fmt::format("the picture is {}; try --opacity auto --opacity-unit {:.2g} or --view iso", what,
                       scene.transfer_function.opacityUnit() / 10);
  std::string stretching = stretchingFor(scene);
  if (!stretching.empty())
    stretching = fmt::format("if layers above one another are seen as one, {}; or ", stretching);
  return fmt::format(
      "the picture is {}; {}try --range 1%,99%, or --clip-box if the outermost layer hides the rest", what,
      stretching);
}

std::string rangeMissesScalar(const VariableInfo& variable, const TransferFunction& transfer_function) {
  const auto [low, high] = transfer_function.range();
  if (low <= variable.max && high >= variable.min) return {};
  return fmt::format(
      "the range {}..{} of the transfer function contains no value of {} (found {}..{}); all samples get the "
      "colour and opacity of one end",
      low, high, variable.name, variable.min, variable.max);
}

}  // namespace curvisplat
