#include "preprocess/formats/netcdf/netcdf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/formats/netcdf/netcdf_files.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;

std::string describeDimensions(const NetcdfFiles& file, const CfGrid& grid) {
  const auto name = [&](size_t axis) { return file.dimensions()[grid.dims.axes[axis]].name; };
  return fmt::format("{} x {} x {}", name(0), name(1), name(2));
}

std::string listDimensions(const NetcdfFiles& file, const CfGrid& grid) {
  const auto name = [&](size_t axis) { return file.dimensions()[grid.dims.axes[axis]].name; };
  return fmt::format("{}, {}, {}", name(0), name(1), name(2));
}

/// Why the indices of the nodes take the place of coordinates.
std::string missingCoordinates(const NetcdfFiles& file, const CfGrid& grid) {
  if (!grid.implausible.empty()) return grid.implausible;
  if (grid.unused.empty())
    return fmt::format("the dimensions {} have no coordinates", listDimensions(file, grid));
  return fmt::format("{} {} three dimensions, expected one or two, and {} not used",
                     fmt::join(grid.unused, " and "), grid.unused.size() == 1 ? "has" : "have",
                     grid.unused.size() == 1 ? "is" : "are");
}

std::map<std::string, std::vector<std::string>> byReason(const std::vector<CfLeftOut>& left_out) {
  std::map<std::string, std::vector<std::string>> reasons;
  for (const CfLeftOut& one : left_out) reasons[one.reason].push_back(one.variable);
  return reasons;
}

bool isCalled(const NetcdfVariable& variable, const std::string& name) {
  const std::string simple = simplifiedName(name);
  return simplifiedName(variable.name) == simple || simplifiedName(variable.text("standard_name")) == simple;
}

/// Indices of the scalar `name`: of its grid, and of the variable in that grid.
std::optional<std::pair<size_t, size_t>> positionOf(const std::vector<CfGrid>& grids,
                                                    const std::string& name) {
  for (const bool exact : {true, false})
    for (size_t g = 0; g < grids.size(); ++g)
      for (size_t v = 0; v < grids[g].variables.size(); ++v) {
        const NetcdfVariable& variable = *grids[g].variables[v];
        if (exact ? variable.name == name : isCalled(variable, name)) return std::pair(g, v);
      }
  return std::nullopt;
}

}  // namespace

NetcdfSource::NetcdfSource(const OpenGridOptions& options, const NetcdfSource* beside)
    : file_(options),
      grid_(chooseGrid(file_, options, description_, mask_)),
      globe_(beside ? beside->globe_ : globeOf(options.globe)) {
  grid_.vertical.setRadius(options.globe.radius_km);
  const uint64_t faces = grid_.dims.face ? file_.dimensions()[*grid_.dims.face].length : 1;
  for (uint64_t face = 0; face < faces; ++face) {
    CfGrid grid = grid_;
    grid.setFace(face);
    blocks_.emplace_back(file_, std::move(grid), globe_, mask_);
  }
  describe(options);
}

namespace {

/// Names the XDMF file beside an HDF5 file, which may describe its arrays, or says what to write.
std::string adviceOnHdf5(const std::filesystem::path& path) {
  for (const char* const ending : {".xmf", ".xdmf"})
    for (const std::filesystem::path& name : {path.stem(), path.filename()}) {
      const std::filesystem::path beside = path.parent_path() / (name.string() + ending);
      if (isRegularFile(beside))
        return fmt::format("give {} instead, which may describe its arrays", beside.string());
    }
  return "describe its arrays in an XDMF file (.xmf), or write NetCDF-4 or CGNS";
}

/// The variable that comes nearest to a grid's, and what it lacks.
std::string nearestToGrid(const NetcdfFiles& file) {
  const NetcdfVariable* nearest = nullptr;
  std::vector<std::string> dims;
  std::set<std::string> bounds;
  for (const NetcdfVariable& variable : file.variables()) bounds.insert(variable.text("bounds"));
  for (const NetcdfVariable& variable : file.variables()) {
    if (bounds.contains(variable.name) || cfRole(file, variable) != CfRole::kNone) continue;
    std::vector<std::string> names;
    for (size_t axis = 0; axis < variable.dims.size(); ++axis) {
      const NetcdfDimension& dim = file.dimension(variable, axis);
      const NetcdfVariable* const coordinate = file.find(dim.name);
      const bool time = coordinate && cfRole(file, *coordinate) == CfRole::kTime;
      if (dim.length > 1 && !time) names.push_back(dim.name);
    }
    if (!variable.numeric || (nearest && names.size() <= dims.size())) continue;
    nearest = &variable;
    dims = names;
  }
  if (!nearest || dims.empty()) return "no variable has three dimensions in space";
  std::string text = fmt::format("no variable has three dimensions in space; {} has {} ({})", nearest->name,
                                 dims.size(), fmt::join(dims, ", "));
  // Both longitude and latitude along one dimension.
  const auto along_last = [&](CfRole role) {
    return std::any_of(file.variables().begin(), file.variables().end(), [&](const NetcdfVariable& variable) {
      return variable.dims.size() == 1 && file.dimension(variable, 0).name == dims.back() &&
             variable.name != dims.back() && cfRole(file, variable) == role;
    });
  };
  if (dims.size() == 2 && along_last(CfRole::kLongitude) && along_last(CfRole::kLatitude))
    text +=
        ", the cells of an unstructured map: give the grid file that has their faces after it (ICON's "
        "icon_grid.nc, MPAS' or UGRID's mesh)";
  if (std::ranges::any_of(dims, [](const std::string& dim) { return dim == "nod2" || dim == "elem"; }))
    text += ", the points or cells of FESOM: give its mesh file (fesom.mesh.diag.nc) after it";
  return text;
}

}  // namespace

CfGrid NetcdfSource::chooseGrid(const NetcdfFiles& file, const OpenGridOptions& options,
                                GridDescription& description, size_t& mask) {
  CfGrids found = findCfGrids(file, options.time_step.value_or(0));
  if (found.grids.empty()) {
    if (const auto format = foreignNetcdf(file))
      throw Error("{}: is {}; {}", file.path().string(), *format,
                  file.plainHdf5() ? adviceOnHdf5(file.path())
                                   : "structured grids are read, and UGRID, ICON, MPAS and FESOM with the "
                                     "file of their faces and nodes (give it after this one)");
    std::string why = nearestToGrid(file);
    if (!file.groups().empty() && std::filesystem::is_directory(file.path()))
      why =
          fmt::format("its arrays are in groups ({}), each of which is a store: give the folder of one ({})",
                      listed(file.groups(), kNamesListed), (file.path() / file.groups().front()).string());
    else if (!file.groups().empty())
      why = fmt::format(
          "its variables are in groups ({}), which are not read: write a group to a file of its own (ncks -G "
          ": -g {} {} OUT)",
          listed(file.groups(), kNamesListed), file.groups().front(), file.path().filename().string());
    if (!found.left_out.empty()) {
      const auto reasons = byReason(found.left_out);
      why = fmt::format("{}: {}", listed(reasons.begin()->second, kNamesListed), reasons.begin()->first);
    }
    throw Error("{}: has no grid by the CF conventions: {}", file.path().string(), why);
  }

  // The grid of most of the first file's fields, which is that of the data; masks and meshes are in further files.
  const auto fieldsOf = [&](const CfGrid& grid) {
    size_t first = 0, all = 0;
    for (const NetcdfVariable* variable : grid.variables)
      if (isField(file, *variable, found)) {
        ++all;
        first += variable->file == 0;
      }
    return std::tuple(first, all, grid.variables.size());
  };
  size_t chosen = 0;
  for (size_t g = 1; g < found.grids.size(); ++g)
    if (fieldsOf(found.grids[g]) > fieldsOf(found.grids[chosen])) chosen = g;
  std::string chooser;
  for (const std::string& name : options.scalars) {
    const auto position = positionOf(found.grids, name);
    if (!position) continue;  // a derived scalar, or a wrong name, which scalarsNamed() reports
    if (!chooser.empty() && position->first != chosen)
      throw Error("{}: {} and {} are on different grids ({} and {}); convert each to a cache of its own",
                  file.path().string(), chooser, name, listDimensions(file, found.grids[chosen]),
                  listDimensions(file, found.grids[position->first]));
    if (chooser.empty()) mask = position->second;
    chosen = position->first;
    chooser = name;
  }
  for (size_t g = 0; g < found.grids.size(); ++g) {
    if (g == chosen) continue;
    std::vector<std::string> names;
    for (const NetcdfVariable* variable : found.grids[g].variables) names.push_back(variable->name);
    std::string where = listDimensions(file, found.grids[g]);
    if (where == listDimensions(file, found.grids[chosen]))
      where += fmt::format(" at {}, {}", found.grids[g].longitude.variable().name,
                           found.grids[g].latitude.variable().name);
    description.warnings.push_back(
        fmt::format("left out: {}, on another grid ({}); select that grid with --scalar NAME",
                    listed(names, kNamesListed), where));
  }
  for (const auto& [reason, names] : byReason(found.left_out))
    description.warnings.push_back(fmt::format("left out: {}: {}", listed(names, kNamesListed), reason));
  return std::move(found.grids[chosen]);
}

Globe NetcdfSource::globeOf(const GlobeOptions& options) const {
  if (!grid_.degrees && !grid_.projection && options.shape == GlobeOptions::Shape::kSphere)
    throw Error("{}: {} and {} are lengths; --sphere needs degrees, or a map projection: leave it out",
                file_.path().string(), grid_.longitude.variable().name, grid_.latitude.variable().name);
  // The map is cut opposite the middle of the grid.
  CfRange middle;
  for (size_t axis = 0; axis < 3; ++axis) {
    middle.begin[axis] = file_.dimensions()[grid_.dims.axes[axis]].length / 2;
    middle.end[axis] = middle.begin[axis] + 1;
  }
  const bool flat = options.shape == GlobeOptions::Shape::kFlat;
  // A projected map stays the flat map that it is.
  const bool degrees = grid_.degrees || (grid_.projection && !flat);
  double longitude = 0;
  if (degrees && flat) {
    longitude = grid_.longitude.read(file_, middle).values.at(0);
    double latitude = grid_.latitude.read(file_, middle).values.at(0);
    if (grid_.projection) grid_.projection->toGeographic({&longitude, 1}, {&latitude, 1});
  }
  return globeWith(options, degrees, longitude);
}

void NetcdfSource::describe(const OpenGridOptions& options) {
  description_.files = file_.paths();
  if (!grid_.indices) description_.globe = globe_;
  const CfTimes times = cfTimes(file_, grid_);
  description_.times = times.values;
  description_.time_unit = times.unit;
  description_.calendar = times.calendar;
  if (grid_.dims.time && description_.times.empty())
    throw Error("{}: has no time step: dimension {} has length 0", file_.path().string(),
                file_.dimensions()[*grid_.dims.time].name);
  description_.time_step = chosenTimeStep(file_.path().string(), description_.times, options.time_step);

  const auto length = [&](size_t axis) { return file_.dimensions()[grid_.dims.axes[axis]].length; };
  for (size_t face = 0; face < blocks_.size(); ++face) {
    const std::string name = grid_.dims.face
                                 ? fmt::format("{} {}", file_.dimensions()[*grid_.dims.face].name, face + 1)
                                 : describeDimensions(file_, grid_);
    description_.blocks.push_back({name, length(0), length(1), length(2), true});
  }
  for (const NetcdfVariable* variable : grid_.variables) {
    GridScalar scalar{variable->name, variable->text("units"), {}, 0, Centring::kNode};
    if (const std::string name = simplifiedName(variable->text("standard_name")); !name.empty())
      scalar.aliases.push_back(name);
    description_.scalars.push_back(std::move(scalar));
  }
  if (const std::string missing = file_.missingValues(*grid_.variables[mask_]); !missing.empty())
    description_.blanking =
        fmt::format("{} is missing where it is {}", grid_.variables[mask_]->name, missing);
  description_.coordinate_bytes =
      std::max(grid_.longitude.variable().value_bytes, grid_.latitude.variable().value_bytes) > 4 ? 8 : 4;
  if (grid_.mask)
    description_.blanking +=
        fmt::format("{}{}", description_.blanking.empty() ? "" : ", or where ", grid_.mask->description());
  if (grid_.surface_first)
    description_.warnings.push_back(
        fmt::format("the first level of {} is that of the ground, above others; it is left out",
                    file_.dimensions()[grid_.dims.axes[grid_.levels]].name));
  for (const auto* warnings : {&grid_.vertical.warnings(), &file_.warnings()})
    description_.warnings.insert(description_.warnings.end(), warnings->begin(), warnings->end());
  const std::string unit = grid_.longitude.variable().text("units");
  if (!grid_.degrees && !grid_.indices && !kilometresOf(unit))
    description_.warnings.push_back(fmt::format(
        "{} and {} {}; metres are assumed", grid_.longitude.variable().name, grid_.latitude.variable().name,
        isUnitless(unit) ? "have no unit of length"
                         : fmt::format("have the unit '{}', which is no length", unit)));
  if (const std::string small = lowerCase(unit); small == "degrees_west" || small == "degree_west")
    description_.warnings.push_back(fmt::format(
        "{0} has the unit '{1}', and is read as degrees east; if it counts to the west, change its sign "
        "(ncap2 -s '{0}=-{0}' IN OUT)",
        grid_.longitude.variable().name, unit));
  if (grid_.indices)
    description_.warnings.push_back(
        fmt::format("{}; the indices of the nodes take their place", missingCoordinates(file_, grid_)));

  const std::string shape = globe_.sphere() ? fmt::format("on a sphere of {:g} km", options.globe.radius_km)
                            : globe_.degrees()
                                ? fmt::format("on a flat map of a sphere of {:g} km", options.globe.radius_km)
                                : "flat";
  const std::string projection = grid_.projection ? fmt::format(" ({})", grid_.projection->name()) : "";
  description_.format =
      fmt::format("{}, {}, {}{} {}, vertical {} times {:g}, in km", file_.kind(),
                  grid_.longitude.variable().name, grid_.latitude.variable().name, projection, shape,
                  grid_.vertical.description(), options.globe.vertical_scale);
  if (!file_.selected().empty()) description_.format += ", " + file_.selected();
  if (!grid_.steps_of.empty())
    description_.notes.push_back(
        fmt::format("the steps are the {} values of {}", description_.times.size(), grid_.steps_of));
  if (grid_.dims.time)
    description_.format +=
        fmt::format(", time step {} of {}", description_.time_step, description_.times.size());
  if (std::string warning = noteOnSagitta(); !warning.empty())
    description_.warnings.push_back(std::move(warning));
  if (const double share = shareOfZeros(); share > 0)
    description_.warnings.push_back(
        fmt::format("{} is exactly 0 at {:.0f} % of the nodes, at all levels, which may be land; --blank 0 "
                    "leaves these out",
                    grid_.variables[mask_]->name, 100 * share));
}

/// How far the middle of a cell of the first level lies below the sphere at most, in radii. A cell is as flat as its corners'
/// mean.
double NetcdfSource::deepestCell(const CfNodes& block) const {
  const uint64_t ni = description_.blocks[0].ni, nj = description_.blocks[0].nj;
  const std::vector<glm::dvec3> points = block.points({{}, {ni, nj, 1}});
  double deepest = 0;
  for (uint64_t j = 0; j + 1 < nj; ++j)
    for (size_t n = j * ni; n + 1 < (j + 1) * ni; ++n) {
      const glm::dvec3 middle = 0.25 * (points[n] + points[n + 1] + points[n + ni] + points[n + ni + 1]);
      if (const double depth = 1 - glm::length(middle); depth > deepest) deepest = depth;
    }
  return deepest;
}

/// The least mean thickness of a layer in the block's middle row, as drawn, in kilometres; infinite if there is none.
double NetcdfSource::thinnestLayer(const CfNodes& block) const {
  const uint64_t ni = description_.blocks[0].ni, nj = description_.blocks[0].nj,
                 nk = description_.blocks[0].nk;
  NodeArrays nodes;
  block.read({{0, nj / 2, 0}, {ni, nj / 2 + 1, nk}}, {}, nodes);
  const auto radius = [&](size_t n) { return glm::length(glm::dvec3(nodes.x[n], nodes.y[n], nodes.z[n])); };
  double thinnest = std::numeric_limits<double>::infinity();
  for (uint64_t k = 0; k + 1 < nk; ++k) {
    double sum = 0, count = 0;
    for (size_t n = k * ni; n < (k + 1) * ni; ++n) {
      const double thickness = std::abs(radius(n + ni) - radius(n));
      if (!(thickness > 0)) continue;  // below the ground
      sum += thickness;
      ++count;
    }
    if (count > 0) thinnest = std::min(thinnest, sum / count);
  }
  return thinnest;
}

std::string NetcdfSource::noteOnSagitta() const {
  // Cells of more columns are smaller than 20 km, and lie less than 10 m below the sphere.
  constexpr uint64_t kMaxColumns = 1 << 21;
  const GridBlock& block = description_.blocks[0];
  if (!onSphere() || block.nk < 2 || block.ni * block.nj * blocks_.size() > kMaxColumns) return "";
  double deepest = 0, thinnest = std::numeric_limits<double>::infinity();
  for (const CfNodes& nodes : blocks_) {
    deepest = std::max(deepest, deepestCell(nodes));
    thinnest = std::min(thinnest, thinnestLayer(nodes));
  }
  return warningOfSagitta(globe_.radius_km * deepest, thinnest);
}

/// Detects a file that marks land by zeros alone: the share of columns that are 0 at the first, middle and
/// last level, in a row in the middle and those a quarter from the ends. 0 if less than a hundredth, if all,
/// in the air, and where values are missing or a mask tells.
double NetcdfSource::shareOfZeros() const {
  const GridBlock& block = description_.blocks[0];
  if (grid_.levels != 2 || grid_.mask || !isOcean(file_, grid_)) return 0;
  uint64_t zero = 0, all = 0;
  for (const uint64_t quarter : {1, 2, 3}) {
    const uint64_t j = block.nj * quarter / 4;
    std::vector<uint8_t> zeros(block.ni, 1);
    std::vector<float> values(block.ni);
    for (const uint64_t k : {uint64_t{0}, block.nk / 2, block.nk - 1}) {
      blocks_[0].readScalar({{0, j, k}, {block.ni, j + 1, k + 1}}, mask_, values);
      for (uint64_t i = 0; i < block.ni; ++i) {
        if (std::isnan(values[i])) return 0;
        zeros[i] &= values[i] == 0;
      }
    }
    for (const uint8_t one : zeros) zero += one;
    all += block.ni;
  }
  return zero == all || 100 * zero < all ? 0 : static_cast<double>(zero) / static_cast<double>(all);
}

void NetcdfSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                        NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, <, blocks_.size());
  const uint64_t end = box.endOfRow(description_.blocks[block].ni);
  blocks_[block].read({{box.i0, box.j0, box.k0}, {end, box.j1, box.k1}}, scalars, out);
}

std::vector<glm::dvec3> NetcdfSource::pointsOf(uint32_t block, const CfRange& range) const {
  CURVISPLAT_CHECK_OP(block, <, blocks_.size());
  return blocks_[block].points(range);
}

std::optional<GridClosure> NetcdfSource::closure() const {
  if (!onSphere() || blocks_.size() > 1) return std::nullopt;
  const GridBlock& block = description_.blocks[0];
  return closureOf(block.ni, block.nj, [&](uint64_t j, uint64_t begin, uint64_t end) {
    return pointsOf(0, {{begin, j, 0}, {end, j + 1, 1}});
  });
}

}  // namespace curvisplat
