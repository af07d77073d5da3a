#include "tools/options/surface_arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

#include "preprocess/formats/vtk/vtk_surface.h"
#include "render/mesh/mesh_file.h"
#include "stream/base/error.h"
#include "tools/options/grid_surfaces.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

std::string extensionOf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

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

std::vector<double> parseIsovalues(const std::vector<std::string>& texts) {
  std::vector<double> values;
  for (const std::string& text : texts)
    for (size_t begin = 0; begin <= text.size();) {
      const size_t end = std::min(text.find(',', begin), text.size());
      values.push_back(parseNumber("--iso", text.substr(begin, end - begin)));
      begin = end + 1;
    }
  return values;
}

double parseIsoOpacity(const std::string& text) {
  if (text.empty()) return kIsoOpacity;
  const double opacity = parseNumber("--iso-opacity", text);
  if (!(opacity > 0 && opacity <= 0.99))
    throw UsageError("--iso-opacity {}: expected a number above 0 and at most 0.99", text);
  return opacity;
}

glm::vec3 parseColour(const std::string& text) {
  if (text == "transparent")
    throw UsageError("--surface-colour transparent: surfaces are opaque; give #rrggbb");
  return glm::vec3(parseBackground("--surface-colour", text));
}

TriangleMesh meshFromFile(const std::filesystem::path& path) {
  if (!isVtp(path)) return readMeshFile(path);
  VtkSurface surface = readVtkSurface(path);
  return meshOf({std::move(surface.points), std::move(surface.triangles)});
}

void requireIsovalues(const SurfaceScene& scene, const CacheReader& cache, size_t drawn) {
  if (drawn >= cache.manifest().variables.size()) return;  // of a window, which may show any
  const VariableInfo& info = cache.manifest().variables[drawn];
  for (const double value : scene.isovalues)
    if (!(value >= info.min && value <= info.max))
      throw Error("--iso {}: no isosurface: the values of {} go from {:.6g} to {:.6g}", value, info.name,
                  info.min, info.max);
}

/// Faces are those of the first step: another geometry has others, and other steps have other values.
void requireFacesOfSteps(const SurfaceArguments& arguments, const CacheReader& cache) {
  const auto& steps = cache.series().steps;
  if (std::any_of(steps.begin(), steps.end(), [](const auto& step) { return step.geometry > 0; }))
    throw Error("{}: --surface: the grid of the series moves, and the cache has its first step's faces only",
                cache.cachePath().string());
  if (!arguments.surface_by.empty() && steps.size() > 1 && cache.step() > 0)
    throw Error("{}: --surface-by {}: the faces have the values of step 0, and step {} is drawn",
                cache.cachePath().string(), arguments.surface_by, cache.step());
}

}  // namespace

void addSurfaceOptions(CLI::App& command, SurfaceArguments& arguments, const std::string& group) {
  command
      .add_option(
          "--surface", arguments.surfaces,
          "Opaque surface in the volume, lit: faces of the grid (imin, imax, ... kmax, \"block 3:k=min\", "
          "all, "
          "walls, or a boundary condition's name; several with commas), or an STL, PLY, OBJ or VTP file in "
          "coordinates before --scale; repeatable")
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
      .add_option(
          "--surface-by", arguments.surface_by,
          "Colour the grid's faces by this scalar: the transfer function's colours if it is the one that "
          "is drawn, else colours chosen from its data")
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
  command
      .add_option(
          "--iso", arguments.isovalues,
          "Isosurfaces of the scalar at VALUE,VALUE,..., lit, in the transfer function's colours; repeatable")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--iso-opacity", arguments.iso_opacity,
                  "Opacity of the isosurfaces, above 0 and at most 0.99 (default 0.95)")
      ->group(group);
  command
      .add_option("--volume", arguments.volume, "on, or off to draw surfaces, slices and isosurfaces alone")
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
  if (!arguments.surface_by.empty() &&
      std::all_of(arguments.surfaces.begin(), arguments.surfaces.end(), isSurfaceFile))
    throw UsageError("--surface-by {} needs faces of the grid, such as --surface kmin", arguments.surface_by);
  if (arguments.volume != "on" && arguments.volume != "off")
    throw UsageError("--volume {}: expected on or off", arguments.volume);
  parseIsovalues(arguments.isovalues);
  parseIsoOpacity(arguments.iso_opacity);
  if (!arguments.iso_opacity.empty() && arguments.isovalues.empty())
    throw UsageError("--iso-opacity needs an isosurface: --iso VALUE");
  if (arguments.volume == "off" && arguments.surfaces.empty() && arguments.slices.empty() &&
      arguments.isovalues.empty())
    throw UsageError("--volume off leaves nothing to draw; give a --slice, a --surface or an --iso");
}

bool isVtp(const std::filesystem::path& path) {
  return extensionOf(path) == ".vtp";
}

bool isSurfaceFile(const std::string& text) {
  std::error_code ignored;
  if (std::filesystem::exists(text, ignored)) return true;
  const std::string extension = extensionOf(text);
  return text.find('/') != std::string::npos || extension == ".stl" || extension == ".ply" ||
         extension == ".obj" || extension == ".vtp";
}

std::shared_ptr<const SurfaceScene> sceneOf(const SurfaceArguments& arguments, const CacheReader& cache,
                                            size_t drawn, size_t classified) {
  if (!arguments.given()) return nullptr;
  auto scene = std::make_shared<SurfaceScene>();
  const bool of_grid = !std::all_of(arguments.surfaces.begin(), arguments.surfaces.end(), isSurfaceFile);
  if (of_grid) requireFacesOfSteps(arguments, cache);
  const auto faces = of_grid ? FacesReader::open(cache.path(), cache.manifest()) : nullptr;
  for (size_t n = 0; n < arguments.surfaces.size(); ++n) {
    const glm::vec3 colour =
        arguments.colours.empty()
            ? Surface().colour
            : parseColour(arguments.colours.size() == 1 ? arguments.colours[0] : arguments.colours.at(n));
    if (isSurfaceFile(arguments.surfaces[n])) {
      Surface& surface = scene->surfaces.emplace_back();
      surface.mesh = std::make_shared<TriangleMesh>(meshFromFile(arguments.surfaces[n]));
      surface.colour = colour;
      continue;
    }
    GridSurface& surface =
        scene->grid_surfaces.emplace_back(gridSurfaceNamed(arguments.surfaces[n], cache, faces));
    surface.colour = colour;
    if (!arguments.surface_by.empty()) colourByScalar(surface, arguments.surface_by, cache, drawn);
  }
  scene->slices = parseSlices(arguments.slices);
  scene->slice_opacity = parseSliceOpacity(arguments.slice_opacity);
  scene->isovalues = parseIsovalues(arguments.isovalues);
  scene->iso_opacity = parseIsoOpacity(arguments.iso_opacity);
  scene->volume = arguments.volume == "on";
  requireIsovalues(*scene, cache, classified);
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
