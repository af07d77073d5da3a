#include "tools/options/surface_arguments.h"

#include <fmt/format.h>

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

#include "render/mesh/mesh_file.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

std::vector<ClipPlane> parseSlices(const std::vector<std::string>& texts) {
  if (texts.size() > kMaxSlices)
    throw UsageError("--slice: given {} times; a picture has at most {} slices", texts.size(), kMaxSlices);
  std::vector<ClipPlane> planes;
  for (const std::string& text : texts) {
    const auto n = parseNumbers("--slice", text, "px,py,pz,nx,ny,nz");
    const ClipPlane plane{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
    if (!isUsable(plane))
      throw UsageError("--slice {}: the normal nx,ny,nz has no direction; give one that is not 0,0,0", text);
    planes.push_back(plane);
  }
  return planes;
}

double parseSliceOpacity(const std::string& text) {
  const double opacity = parseNumber("--slice-opacity", text);
  if (!(opacity > 0 && opacity <= 1))
    throw UsageError("--slice-opacity {}: expected a number above 0 and at most 1", text);
  return opacity;
}

glm::vec3 parseColour(const std::string& text) {
  if (text == "transparent")
    throw UsageError("--surface-colour transparent: surfaces are opaque; give #rrggbb");
  return glm::vec3(parseBackground("--surface-colour", text));
}

}  // namespace

void addSurfaceOptions(CLI::App& command, SurfaceArguments& arguments, const std::string& group) {
  command
      .add_option(
          "--surface", arguments.surfaces,
          "Opaque surface in the volume, lit: an STL, PLY or OBJ file, in coordinates before --scale; "
          "repeatable")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--surface-colour", arguments.colours,
                  "Colour #rrggbb of the surfaces, or one for each in their order (default #b3b3b3)")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--slice", arguments.slices,
                  "Slice px,py,pz,nx,ny,nz through the point p, at right angles to n, with the transfer "
                  "function's colours. In coordinates before --scale; repeatable, up to 8")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--slice-opacity", arguments.slice_opacity, "Opacity of the slices, above 0 and at most 1")
      ->capture_default_str()
      ->group(group);
  command.add_option("--volume", arguments.volume, "on, or off to draw surfaces and slices alone")
      ->capture_default_str()
      ->group(group);
}

void checkSurfaceArguments(const SurfaceArguments& arguments) {
  parseSlices(arguments.slices);
  parseSliceOpacity(arguments.slice_opacity);
  for (const std::string& colour : arguments.colours) parseColour(colour);
  if (arguments.colours.size() > 1 && arguments.colours.size() != arguments.surfaces.size())
    throw UsageError(
        "--surface-colour: given {} times for {} surfaces; give it once, or once for each --surface",
        arguments.colours.size(), arguments.surfaces.size());
  if (!arguments.colours.empty() && arguments.surfaces.empty())
    throw UsageError("--surface-colour needs a surface: --surface FILE");
  if (arguments.volume != "on" && arguments.volume != "off")
    throw UsageError("--volume {}: expected on or off", arguments.volume);
  if (arguments.volume == "off" && arguments.surfaces.empty() && arguments.slices.empty())
    throw UsageError("--volume off leaves nothing to draw; give a --slice or a --surface");
}

std::shared_ptr<const SurfaceScene> sceneOf(const SurfaceArguments& arguments) {
  if (!arguments.given()) return nullptr;
  auto scene = std::make_shared<SurfaceScene>();
  for (size_t n = 0; n < arguments.surfaces.size(); ++n) {
    Surface& surface = scene->surfaces.emplace_back();
    surface.mesh = std::make_shared<TriangleMesh>(readMeshFile(arguments.surfaces[n]));
    if (!arguments.colours.empty())
      surface.colour =
          parseColour(arguments.colours.size() == 1 ? arguments.colours[0] : arguments.colours.at(n));
  }
  scene->slices = parseSlices(arguments.slices);
  scene->slice_opacity = parseSliceOpacity(arguments.slice_opacity);
  scene->volume = arguments.volume == "on";
  return scene;
}

std::vector<std::string> slicesThatMiss(const SurfaceArguments& arguments, const glm::dvec3& lower,
                                        const glm::dvec3& upper) {
  std::vector<std::string> misses;
  const std::vector<ClipPlane> slices = parseSlices(arguments.slices);
  for (size_t n = 0; n < slices.size(); ++n) {
    const double middle = glm::dot(slices[n].normal, 0.5 * (lower + upper) - slices[n].point);
    const double reach = glm::dot(glm::abs(slices[n].normal), 0.5 * (upper - lower));
    if (std::abs(middle) > reach)
      misses.push_back(
          fmt::format("--slice {} misses the data, which lies in x {:.6g} to {:.6g}, y {:.6g} to {:.6g}, z "
                      "{:.6g} to {:.6g}",
                      arguments.slices[n], lower.x, upper.x, lower.y, upper.y, lower.z, upper.z));
  }
  return misses;
}

}  // namespace curvisplat
