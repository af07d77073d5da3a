#include "tools/options/scene_arguments.h"

#include <CLI/CLI.hpp>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "preprocess/formats/vtk/vtk_surface.h"
#include "render/mesh/curve_set.h"
#include "render/mesh/triangle_mesh.h"
#include "render/surface/curve_times.h"
#include "render/surface/iso_groups.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/cache/faces_file.h"
#include "tools/options/globe_arguments.h"
#include "tools/options/grid_surfaces.h"
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

/// A number, or "function", perhaps with a factor: function, 0.5 or function*0.5.
SheetOpacity parseSheetOpacity(const std::string& option, const std::string& text) {
  constexpr std::string_view kFunction = "function";
  SheetOpacity opacity;
  opacity.by_function = text.starts_with(kFunction);
  const std::string factor = opacity.by_function ? text.substr(kFunction.size()) : text;
  if (opacity.by_function && factor.empty()) return opacity;
  const bool has_form = !opacity.by_function || (factor.starts_with('*') && factor.size() > 1);
  if (has_form) opacity.factor = parseNumber(option, opacity.by_function ? factor.substr(1) : factor);
  if (!has_form || !(opacity.factor > 0 && opacity.factor <= 1))
    throw UsageError("{} {}: expected a number above 0 and at most 1, or function, or function*NUMBER",
                     option, text);
  return opacity;
}

/// The opacity of surface number n.
SheetOpacity surfaceOpacity(const SurfaceArguments& arguments, size_t n) {
  const auto& texts = arguments.surface_opacities;
  return texts.empty() ? SheetOpacity()
                       : parseSheetOpacity("--surface-opacity", texts.size() == 1 ? texts[0] : texts.at(n));
}

void checkSurfaceOpacities(const SurfaceArguments& arguments, bool has_opacities) {
  const auto& texts = arguments.surface_opacities;
  for (const std::string& text : texts)
    if (parseSheetOpacity("--surface-opacity", text).by_function && arguments.surface_by.empty() &&
        !has_opacities)
      throw UsageError("--surface-opacity {}: needs the scalar of the function; add --surface-by NAME", text);
  if (texts.size() > 1 && texts.size() != arguments.surfaces.size())
    throw UsageError(
        "--surface-opacity: given {} times for {} surfaces; give it once, or once for each --surface",
        texts.size(), arguments.surfaces.size());
  if (!texts.empty() && arguments.surfaces.empty())
    throw UsageError("--surface-opacity needs a surface: --surface FILE");
  for (size_t n = 0; n < arguments.surfaces.size(); ++n)
    if (surfaceOpacity(arguments, n).by_function && isSurfaceFile(arguments.surfaces[n]))
      throw UsageError(
          "--surface-opacity: {} is a file and has no scalar for a function; give a number for it, and an "
          "opacity for "
          "each --surface in their order",
          arguments.surfaces[n]);
}

/// The parts between the commas of all texts.
std::vector<std::string> splitAllAtCommas(const std::vector<std::string>& texts) {
  std::vector<std::string> parts;
  for (const std::string& text : texts)
    for (size_t begin = 0; begin <= text.size();) {
      const size_t end = std::min(text.find(',', begin), text.size());
      parts.push_back(text.substr(begin, end - begin));
      begin = end + 1;
    }
  return parts;
}

/// A value of --iso.
struct GivenIsovalue {
  std::string scalar;  // empty: the picture's
  double value = 0;
};

/// VALUE,... or NAME=VALUE,... each.
std::vector<GivenIsovalue> parseIsovalues(const SurfaceArguments& arguments) {
  std::vector<GivenIsovalue> given;
  for (const std::string& text : arguments.isovalues) {
    const size_t equals = text.rfind('=');
    const std::string scalar = equals == std::string::npos ? arguments.iso_by : text.substr(0, equals);
    if (equals == 0) throw UsageError("--iso {}: no scalar before the '='; expected NAME=VALUE", text);
    const size_t inner = equals == std::string::npos ? equals : scalar.find('=');  // or of a name
    if (inner != std::string::npos && scalar.find(',', inner) != std::string::npos)
      throw UsageError("--iso {}: has two scalars; give --iso NAME=VALUE,... once for each", text);
    for (const std::string& value :
         splitAllAtCommas({text.substr(equals == std::string::npos ? 0 : equals + 1)}))
      given.push_back({scalar, parseNumber("--iso", value)});
  }
  return given;
}

/// A colour for each isosurface, in their order; empty: all have the function's.
std::vector<std::optional<glm::vec3>> parseIsoColours(const SurfaceArguments& arguments) {
  std::vector<std::optional<glm::vec3>> colours;
  for (const std::string& text : splitAllAtCommas(arguments.iso_colours))
    colours.push_back(text == "function" ? std::nullopt : std::optional(parseColour("iso", text)));
  const size_t count = parseIsovalues(arguments).size();
  if (!colours.empty() && count == 0) throw UsageError("--iso-colour needs an isosurface: --iso VALUE");
  if (colours.size() == 1)
    for (size_t n = 1; n < count; ++n) colours.push_back(colours.front());
  if (!colours.empty() && colours.size() != count)
    throw UsageError(
        "--iso-colour: has {} colours for {} isosurfaces; give one, or one for each value of --iso",
        colours.size(), count);
  return colours;
}

bool hasSurfaceEnding(const std::filesystem::path& path) {
  const std::string extension = extensionOf(path);
  return extension == ".stl" || extension == ".ply" || extension == ".obj" || extension == ".vtp";
}

TriangleMesh meshFromFile(const std::filesystem::path& path) {
  if (!hasSurfaceEnding(path))
    throw Error("{}: unknown surface format (extension '{}'); STL, PLY, OBJ and VTP files can be read",
                path.string(), extensionOf(path));
  if (!isVtp(path)) return readMeshFile(path);
  VtkSurface surface = readVtkSurface(path);
  return meshOf({std::move(surface.points), std::move(surface.triangles)});
}

size_t isoVariable(const GivenIsovalue& given, const CacheReader& cache) {
  try {
    return cache.variableNamed(given.scalar);
  } catch (const UsageError& error) {
    throw UsageError("--iso {}={:g}: {}", given.scalar, given.value, error.what());
  }
}

/// Puts the isosurfaces into the scene: those of the picture's scalar, and by scalar those of others.
void addIsosurfaces(const SurfaceArguments& arguments, const CacheReader& cache, const SceneScalars& scalars,
                    SurfaceScene& scene) {
  const auto& own = scalars.opacities;
  const std::vector<std::optional<glm::vec3>> colours = parseIsoColours(arguments);
  const std::vector<GivenIsovalue> given = parseIsovalues(arguments);
  for (size_t n = 0; n < given.size(); ++n) {
    const double value = given[n].value;
    const auto variable = given[n].scalar.empty() ? own : isoVariable(given[n], cache);
    if (variable) {
      const VariableInfo& info = cache.manifest().variables[*variable];
      if (!(value >= info.min && value <= info.max))
        throw UsageError("--iso {}: no isosurface: the values of {} go from {:.6g} to {:.6g}", value,
                         info.name, info.min, info.max);
    }
    std::vector<double>* values = &scene.isovalues;
    std::vector<std::optional<glm::vec3>>* of_values = &scene.iso_colours;
    if (variable != own) {
      auto further = std::ranges::find(scene.further_isosurfaces, *variable, &FurtherIsosurfaces::variable);
      if (further == scene.further_isosurfaces.end())
        further = scene.further_isosurfaces.insert(further, FurtherIsosurfaces{*variable});
      values = &further->values;
      of_values = &further->own_colours;
    }
    values->push_back(value);
    if (!colours.empty()) of_values->push_back(colours[n]);
  }
}

}  // namespace

void addSurfaceOptions(CLI::App& command, SurfaceArguments& arguments, const std::string& group) {
  command
      .add_option(
          "--surface", arguments.surfaces,
          "Opaque surface in the volume, lit: faces of the grid (imin, imax, ... kmax, \"block 3:k=min\", "
          "all, blanks (between drawn and blanked cells), "
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
      .add_option("--surface-by", arguments.surface_by,
                  "Colour the grid's faces by this scalar, by the transfer function if it is the scalar "
                  "drawn, otherwise by colours chosen from its data")
      ->group(group);
  command
      .add_option(
          "--surface-opacity", arguments.surface_opacities,
          "Opacity of the surfaces, above 0 and at most 1, or one for each in their order (default "
          "1); function: by the transfer function of the --surface-by scalar, or with --opacity-by that of "
          "its scalar; function*NUMBER: NUMBER times that")
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
      .add_option("--slice-opacity", arguments.slice_opacity,
                  "Opacity of the slices, above 0 and at most 1; function: by the transfer function (that of "
                  "--opacity-by, if given); function*NUMBER: NUMBER times that")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--iso", arguments.isovalues,
                  "Isosurfaces of the scalar at VALUE,VALUE,..., lit, in the transfer function's colours; "
                  "NAME=VALUE,... of another scalar, in the colours that --scalar has there; repeatable")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--iso-by", arguments.iso_by,
                  "Scalar of the values of --iso that are given without a NAME (default: the --opacity-by "
                  "scalar if given, otherwise --scalar)")
      ->group(group);
  command
      .add_option("--iso-colour", arguments.iso_colours,
                  "Colour #rrggbb of the isosurfaces, or one for each value of --iso, with commas; function: "
                  "the transfer function's (default)")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option(
          "--iso-opacity", arguments.iso_opacity,
          "Opacity of the isosurfaces, above 0 and at most 1; function: by the transfer function (that of "
          "--opacity-by, if given; not of a third scalar's); function*NUMBER: NUMBER times that")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--volume", arguments.volume,
                  "Draw the volume: on, or off for surfaces, slices and isosurfaces alone")
      ->capture_default_str()
      ->group(group);
  addCurveOptions(command, arguments.curves, group);
  addMapOptions(command, arguments.map, group);
  addGlobeOption(command, arguments.globe, group);
}

void checkSurfaceArguments(const SurfaceArguments& arguments, bool has_opacities) {
  parseSlices(arguments.slices);
  const SheetOpacity of_slices = parseSheetOpacity("--slice-opacity", arguments.slice_opacity);
  if (!of_slices.opaque() && arguments.slices.empty() && !arguments.film_has_slices)
    throw UsageError("--slice-opacity needs a slice: --slice PX,PY,PZ,NX,NY,NZ");
  checkSurfaceOpacities(arguments, has_opacities);
  for (const std::string& colour : arguments.colours) parseColour("surface", colour);
  if (arguments.colours.size() > 1 && arguments.colours.size() != arguments.surfaces.size())
    throw UsageError(
        "--surface-colour: given {} times for {} surfaces; give it once, or once for each --surface",
        arguments.colours.size(), arguments.surfaces.size());
  if (!arguments.colours.empty() && arguments.surfaces.empty())
    throw UsageError("--surface-colour needs a surface: --surface FILE");
  if (!arguments.surface_by.empty() &&
      std::all_of(arguments.surfaces.begin(), arguments.surfaces.end(), isSurfaceFile))
    throw UsageError("--surface-by {} needs faces of the grid, such as --surface kmin", arguments.surface_by);
  requireChoice("--volume", arguments.volume, {"on", "off"});
  parseIsovalues(arguments);
  if (!arguments.iso_by.empty() && arguments.isovalues.empty())
    throw UsageError("--iso-by {}: needs an isosurface: --iso VALUE", arguments.iso_by);
  const auto has_name = [](const std::string& text) { return text.find('=') != std::string::npos; };
  if (!arguments.iso_by.empty() && std::ranges::all_of(arguments.isovalues, has_name))
    throw UsageError("--iso-by {}: each --iso names its own scalar; leave one of the two out",
                     arguments.iso_by);
  parseIsoColours(arguments);
  const SheetOpacity of_isosurfaces = parseSheetOpacity("--iso-opacity", arguments.iso_opacity);
  if (!of_isosurfaces.opaque() && arguments.isovalues.empty())
    throw UsageError("--iso-opacity needs an isosurface: --iso VALUE");
  checkCurveArguments(arguments.curves);
  checkMapArguments(arguments.map);
  if (arguments.volume == "off" && arguments.surfaces.empty() && arguments.slices.empty() &&
      arguments.isovalues.empty() && !arguments.curves.given() && !arguments.map.map &&
      !arguments.film_has_slices)
    throw UsageError("--volume off leaves nothing to draw; give a --slice, a --surface, an --iso or --lines");
}

std::string surfaceColourWithoutEffect(const SurfaceArguments& arguments) {
  if (arguments.colours.empty() || arguments.surface_by.empty() ||
      std::ranges::any_of(arguments.surfaces,
                          [](const std::string& one) { return isSurfaceFile(one) || one == kBlanks; }))
    return "";
  return fmt::format(
      "--surface-colour {}: has no effect, since --surface-by {} colours the faces; leave one of them out",
      arguments.colours.front(), arguments.surface_by);
}

std::vector<std::string> isoScalars(const SurfaceArguments& arguments) {
  std::vector<std::string> scalars;
  for (const GivenIsovalue& given : parseIsovalues(arguments)) scalars.push_back(given.scalar);
  return scalars;
}

std::vector<AskedIsovalues> askedIsovalues(const SurfaceScene* scene, size_t opacities, size_t colours) {
  std::vector<AskedIsovalues> asked;
  if (!scene) return asked;
  for (const IsoGroup& group : isoGroups(*scene, {opacities, colours}))
    asked.push_back({group.variable, {group.values.begin(), group.values.end()}});
  return asked;
}

bool isVtp(const std::filesystem::path& path) {
  return extensionOf(path) == ".vtp";
}

bool isSurfaceFile(const std::string& text) {
  std::error_code ignored;
  if (std::filesystem::exists(text, ignored)) return true;
  return text.find('/') != std::string::npos || hasSurfaceEnding(text);
}

bool hasFaces(const SurfaceArguments& arguments) {
  return !std::all_of(arguments.surfaces.begin(), arguments.surfaces.end(), isSurfaceFile);
}

std::vector<GridSurface> facesAt(const SurfaceArguments& arguments, const CacheReader& cache,
                                 const std::vector<GridSurface>& first) {
  const bool moves = cache.series().geometries() > 1;
  const bool has_values = !arguments.surface_by.empty() && cache.series().steps.size() > 1;
  const bool has_opacities = std::any_of(
      first.begin(), first.end(), [](const GridSurface& surface) { return !surface.opacity_name.empty(); });
  if (first.empty() || (!moves && !has_values && !has_opacities)) return first;
  std::vector<GridSurface> surfaces = first;
  const auto faces = facesWith(arguments.surface_by, cache);
  size_t of_grid = 0;
  for (const std::string& text : arguments.surfaces) {
    if (isSurfaceFile(text)) continue;
    GridSurface& surface = surfaces.at(of_grid++);
    GridSurface named = gridSurfaceNamed(text, cache, faces);
    surface.faces = named.faces;
    surface.parts = std::move(named.parts);
    if (surface.scalar) surface.scalar = scalarOfFaces(*faces, arguments.surface_by, cache);
    if (!surface.opacity_name.empty()) takeOpacities(surface, surface.opacity_name, cache);
  }
  return surfaces;
}

std::shared_ptr<const SurfaceScene> sceneAt(const SurfaceArguments& arguments, const CacheReader& cache,
                                            const std::shared_ptr<const SurfaceScene>& first) {
  if (!first || first->grid_surfaces.empty()) return sceneAtTime(first, cache.time());
  auto scene = std::make_shared<SurfaceScene>(*first);
  scene->grid_surfaces = facesAt(arguments, cache, first->grid_surfaces);
  return sceneAtTime(std::move(scene), cache.time());
}

std::shared_ptr<const SurfaceScene> sceneOf(const SurfaceArguments& arguments, const CacheReader& cache,
                                            const SceneScalars& scalars) {
  if (!arguments.given()) return nullptr;
  auto scene = std::make_shared<SurfaceScene>();
  const auto faces = hasFaces(arguments) ? facesWith(arguments.surface_by, cache) : nullptr;
  const std::optional<Globe> globe = globeOf(arguments.globe, cache.manifest());
  const std::optional<Surface> earth = mapOf(arguments.map, cache, globe);
  for (size_t n = 0; n < arguments.surfaces.size(); ++n) {
    const glm::vec3 colour =
        arguments.colours.empty()
            ? Surface().colour
            : parseColour("surface",
                          arguments.colours.size() == 1 ? arguments.colours[0] : arguments.colours.at(n));
    if (isSurfaceFile(arguments.surfaces[n])) {
      Surface& surface = scene->surfaces.emplace_back();
      surface.mesh = std::make_shared<TriangleMesh>(meshFromFile(arguments.surfaces[n]));
      surface.colour = colour;
      surface.opacity = surfaceOpacity(arguments, n);
      continue;
    }
    GridSurface& surface =
        scene->grid_surfaces.emplace_back(gridSurfaceNamed(arguments.surfaces[n], cache, faces));
    surface.colour = colour;
    surface.opacity = surfaceOpacity(arguments, n);
    if (arguments.surfaces[n] == kBlanks) {
      if (earth) surface.map = earth->map;
      if (surface.opacity.by_function)
        throw UsageError("--surface-opacity: {} has no values for a function; give a number", kBlanks);
      continue;
    }
    if (!arguments.surface_by.empty())
      colourByScalar(surface, arguments.surface_by, cache, scalars.colours, scalars.maps);
    if (surface.opacity.by_function && scalars.opacity_by && scalars.areTwo())
      takeOpacities(surface, cache.manifest().variables[*scalars.opacities].name, cache);
  }
  if (earth) scene->surfaces.push_back(*earth);
  scene->slices = parseSlices(arguments.slices);
  const SheetOpacity of_slices = parseSheetOpacity("--slice-opacity", arguments.slice_opacity);
  scene->slice_opacity = of_slices.factor;
  scene->slices_by_function = of_slices.by_function;
  scene->iso_opacity = parseSheetOpacity("--iso-opacity", arguments.iso_opacity);
  scene->volume = arguments.volume == "on";
  scene->curves = curvesOf(arguments.curves, cache, globe,
                           scalars.colours ? cache.manifest().variables[*scalars.colours].name : "");
  addIsosurfaces(arguments, cache, scalars, *scene);
  return scene;
}

namespace {

std::string boxText(const glm::dvec3& lower, const glm::dvec3& upper) {
  return fmt::format("x {:.6g} to {:.6g}, y {:.6g} to {:.6g}, z {:.6g} to {:.6g}", lower.x, upper.x, lower.y,
                     upper.y, lower.z, upper.z);
}

/// Whether the box around some segment of the lines, or some point, meets a box.
bool meetsBox(const CurveSet& set, const glm::dvec3& lower, const glm::dvec3& upper) {
  for (size_t line = 0; line < set.lines(); ++line)
    for (uint32_t n = set.begins[line]; n < set.begins[line + 1]; ++n) {
      const uint32_t next = std::min(n + 1, set.begins[line + 1] - 1);
      const glm::dvec3 a = set.origin + glm::dvec3(set.positions[n]),
                       b = set.origin + glm::dvec3(set.positions[next]);
      if (glm::all(glm::lessThanEqual(glm::min(a, b), upper)) &&
          glm::all(glm::greaterThanEqual(glm::max(a, b), lower)))
        return true;
    }
  return false;
}

}  // namespace

std::vector<std::string> curvesThatMiss(const SurfaceArguments& arguments, const SurfaceScene& scene,
                                        const glm::dvec3& lower, const glm::dvec3& upper) {
  std::vector<std::string> misses;
  if (arguments.map.map) return misses;
  const std::vector<std::string>&lines = arguments.curves.lines, &points = arguments.curves.points;
  for (size_t n = 0; n < scene.curves.size(); ++n) {
    const Curves& curves = scene.curves[n];
    if (meetsBox(curves.whole ? *curves.whole : *curves.set, lower, upper)) continue;
    const bool is_line = n < lines.size();
    misses.push_back(fmt::format("{} {}: all of it lies outside of the data, which has {}",
                                 is_line ? "--lines" : "--points",
                                 is_line ? lines[n] : points.at(n - lines.size()), boxText(lower, upper)));
  }
  return misses;
}

std::vector<std::string> slicesThatMiss(const SurfaceArguments& arguments, const glm::dvec3& lower,
                                        const glm::dvec3& upper) {
  std::vector<std::string> misses;
  const std::vector<ClipPlane> slices = parseSlices(arguments.slices);
  for (size_t n = 0; n < slices.size(); ++n) {
    const double middle = glm::dot(slices[n].normal, 0.5 * (lower + upper) - slices[n].point);
    const double reach = glm::dot(glm::abs(slices[n].normal), 0.5 * (upper - lower));
    if (std::abs(middle) > reach)
      misses.push_back(fmt::format("--slice {} misses the data, which lies in {}", arguments.slices[n],
                                   boxText(lower, upper)));
  }
  return misses;
}

}  // namespace curvisplat
