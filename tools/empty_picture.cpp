#include "tools/empty_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

namespace curvisplat {
namespace {

constexpr int kSamples = 4096;

std::string text(const glm::dvec3& point) {
  return fmt::format("({}, {}, {})", point.x, point.y, point.z);
}

/// The largest extinction over the scalar's values.
double largestExtinction(const RenderedScene& scene) {
  double largest = 0;
  for (int n = 0; n <= kSamples; ++n) {
    const double scalar =
        std::lerp(scene.variable.min, scene.variable.max, static_cast<double>(n) / kSamples);
    largest = std::max(largest, scene.transfer_function.at(scalar).extinction);
  }
  return largest;
}

/// The part of the data that the clip box leaves, scaled; false if there is none.
bool visibleBox(const RenderedScene& scene, glm::dvec3& lower, glm::dvec3& upper) {
  lower = scene.manifest.lower;
  upper = scene.manifest.upper;
  if (const auto& clip = scene.options.clip_box) {
    lower = glm::max(lower, clip->lower);
    upper = glm::min(upper, clip->upper);
  }
  for (int axis = 0; axis < 3; ++axis)
    if (lower[axis] > upper[axis]) return false;
  lower *= scene.options.scale;
  upper *= scene.options.scale;
  return true;
}

/// Whether all corners of the box lie beyond one side of what the camera sees.
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
    const bool perspective = camera.projection == Projection::perspective;
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
  for (size_t n = 0; n < image.rgba.size(); ++n)
    if (image.rgba[n] != background[static_cast<int>(n % 4)]) return false;
  return true;
}

std::vector<std::string> whyEmpty(const RenderedScene& scene) {
  std::vector<std::string> reasons;
  const auto [low, high] = scene.transfer_function.range();
  const double largest = largestExtinction(scene);
  if (largest == 0)
    reasons.push_back(fmt::format(
        "the transfer function '{}' over {}..{} is fully transparent for {} in {}..{}; give another "
        "--tf or --range",
        scene.transfer_function.name(), low, high, scene.variable.name, scene.variable.min,
        scene.variable.max));

  glm::dvec3 lower, upper;
  if (!visibleBox(scene, lower, upper)) {
    reasons.push_back(fmt::format("--clip-box has nothing of the data in it, which spans {} to {}",
                                  text(scene.manifest.lower), text(scene.manifest.upper)));
  } else {
    if (outOfView(scene, lower, upper))
      reasons.push_back(fmt::format("the camera at {} looking at {} does not see the data's box {} to {}",
                                    text(scene.camera.position), text(scene.camera.focal_point), text(lower),
                                    text(upper)));
    const double thickest = largest * glm::length(upper - lower);
    if (largest > 0 && thickest < 0.01)
      reasons.push_back(fmt::format(
          "the data is nearly transparent: its optical depth is at most {:.2g}; an --opacity-unit "
          "smaller than {} makes it more opaque",
          thickest, scene.transfer_function.opacityUnit()));
  }
  const FrameStatistics& s = scene.statistics;
  if (reasons.empty())
    reasons.push_back(fmt::format(
        "of {} splats read, {} are outside of --clip-box, {} off the screen, {} transparent and {} drawn, "
        "none of "
        "which reaches a pixel; try --view iso, another --range or another --clip-box",
        s.splats_read, s.splats_clipped, s.splats_off_screen, s.splats_transparent, s.splats_drawn));
  return reasons;
}

std::string rangeMissesScalar(const VariableInfo& variable, const TransferFunction& transfer_function) {
  const auto [low, high] = transfer_function.range();
  if (low <= variable.max && high >= variable.min) return {};
  return fmt::format(
      "the range {}..{} of the transfer function has no value of {} in it, which is in {}..{}: all of it has "
      "the colour and opacity of one end",
      low, high, variable.name, variable.min, variable.max);
}

}  // namespace curvisplat
