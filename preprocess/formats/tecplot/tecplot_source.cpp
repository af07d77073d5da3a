#include "preprocess/formats/tecplot/tecplot_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "preprocess/formats/tecplot/tecplot_data.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr const char* kAxisNames[3][3] = {{"x", "coordinatex", "xcoordinate"},
                                          {"y", "coordinatey", "ycoordinate"},
                                          {"z", "coordinatez", "zcoordinate"}};
constexpr const char* kIblankNames[] = {"iblank"};

/// "x" of "X (m)" and of "X [m]".
std::string nameAlone(const std::string& name) {
  return simplifiedName(name.substr(0, name.find_first_of("([", 1)));
}

}  // namespace

bool isTecplot(const InputFile& file) {
  return isTecplotBinary(file) || isTecplotText(file);
}

TecplotGrid::TecplotGrid(const OpenGridOptions& options) {
  const auto file = std::make_shared<const PooledFile>(std::make_shared<OpenFiles>(), options.grid);
  description.files = {options.grid.string()};
  data = isTecplotBinary(InputFile(options.grid))
             ? readTecplotBinary(file)
             : readTecplotText(file, options.temporary_folder, options.index.get());
  if (data.zones.empty()) throw Error("{}: is a Tecplot file without zones; expected a grid", file->name());
  chooseStep(options);
  leaveOutZones();
  findCoordinates();
  addScalars();
  description.coordinate_bytes = 4;
  for (const TecplotZone& zone : data.zones)
    for (const size_t axis : axes)
      if (zone.values[axis].type == TecplotType::kDouble && !zone.values[axis].from_single)
        description.coordinate_bytes = 8;
  for (size_t n = 0; n < data.zones.size(); ++n) {
    const TecplotZone& zone = data.zones[n];
    const std::string name = zone.name.empty() ? fmt::format("zone {}", n + 1) : zone.name;
    if (zone.elements > 0)
      description.pieces.push_back({name, description.files[0], zone.nodes[0], zone.elements});
    else
      description.blocks.push_back(
          {name, zone.nodes[0], zone.nodes[1], zone.nodes[2], iblank && !zone.values[*iblank].passive});
  }
  description.format =
      fmt::format("Tecplot, {}, {}", data.encoding,
                  countText(data.zones.size(), data.zones[0].elements > 0 ? "zone" : "ordered zone"));
  if (data.zones[0].elements > 0) description.format += " of finite elements";
}

void TecplotGrid::chooseStep(const OpenGridOptions& options) {
  std::set<double> times;
  for (const TecplotZone& zone : data.zones)
    if (zone.time) times.insert(*zone.time);
  description.times.assign(times.begin(), times.end());
  description.time_step = chosenTimeStep(description.files[0], description.times, options.time_step);
  if (times.size() < 2) return;
  const double time = description.times[description.time_step];
  std::erase_if(data.zones, [&](const TecplotZone& zone) { return zone.time && *zone.time != time; });
}

/// Leaves out zones without volume; and those of finite elements where there are others.
void TecplotGrid::leaveOutZones() {
  std::string flat;
  for (size_t n = 0; n < data.zones.size() && flat.empty(); ++n)
    if (const TecplotZone& zone = data.zones[n]; zone.flat())
      flat = zone.elements > 0 ? fmt::format("{} of {}", zone.describe(n), zone.flat_elements)
                               : fmt::format("{} of {}x{}x{} nodes", zone.describe(n), zone.nodes[0],
                                             zone.nodes[1], zone.nodes[2]);
  const size_t all = data.zones.size();
  std::erase_if(data.zones, [](const TecplotZone& zone) { return zone.flat(); });
  if (data.zones.empty())
    throw Error("{}: has no zone with volume: {} is flat; expected a three-dimensional grid",
                description.files[0], flat);
  if (data.zones.size() < all)
    description.warnings.push_back(
        fmt::format("{} of {} zones are flat and left out, such as {}", all - data.zones.size(), all, flat));
  const auto is_ordered = [](const TecplotZone& zone) { return zone.elements == 0; };
  if (std::none_of(data.zones.begin(), data.zones.end(), is_ordered)) return;
  if (const size_t meshes =
          std::erase_if(data.zones, [](const TecplotZone& zone) { return zone.elements > 0; });
      meshes > 0)
    description.warnings.push_back(
        fmt::format("{} of {} zones are of finite elements and left out", meshes, all));
}

std::optional<size_t> TecplotGrid::variableNamed(std::span<const char* const> names) const {
  for (size_t n = 0; n < data.variables.size(); ++n)
    if (std::find(names.begin(), names.end(), nameAlone(data.variables[n])) != names.end()) return n;
  return std::nullopt;
}

void TecplotGrid::findCoordinates() {
  if (data.variables.size() < 3)
    throw Error("{}: has {} variables; expected x, y and z", description.files[0], data.variables.size());
  axes = {0, 1, 2};
  std::array<std::optional<size_t>, 3> found;
  for (size_t axis = 0; axis < 3; ++axis) found[axis] = variableNamed(kAxisNames[axis]);
  if (found[0] && found[1] && found[2])
    axes = {*found[0], *found[1], *found[2]};
  else
    description.warnings.push_back(
        fmt::format("no variables are named x, y and z; the first three ({}, {}, {}) are taken",
                    data.variables[0], data.variables[1], data.variables[2]));
  for (size_t n = 0; n < data.zones.size(); ++n)
    for (const size_t axis : axes) {
      const TecplotValues& values = data.zones[n].values[axis];
      if (values.passive || values.centring == Centring::kCell)
        throw Error("{}: {} has no {} at its nodes; expected coordinates there", description.files[0],
                    data.zones[n].describe(n), data.variables[axis]);
    }
  iblank = variableNamed(kIblankNames);
  const auto of_cells = [&](const TecplotZone& zone) {
    return zone.values[*iblank].centring == Centring::kCell;
  };
  const bool is_mesh = data.zones[0].elements > 0;
  if (iblank && (is_mesh || std::any_of(data.zones.begin(), data.zones.end(), of_cells))) iblank.reset();
  if (iblank) description.blanking = "iblank 0";
}

void TecplotGrid::addScalars() {
  for (size_t n = 0; n < data.variables.size(); ++n) {
    if (std::find(axes.begin(), axes.end(), n) != axes.end() || n == iblank) continue;
    std::array<size_t, 2> zones{};  // of nodes, of cells
    for (const TecplotZone& zone : data.zones)
      if (!zone.values[n].passive) ++zones[static_cast<size_t>(zone.values[n].centring == Centring::kCell)];
    const size_t without = data.zones.size() - zones[0] - zones[1];
    if (without > 0)
      description.warnings.push_back(
          fmt::format("{} of {} zones have no values of {}; they are not drawn with it", without,
                      data.zones.size(), data.variables[n]));
    for (const Centring centring : {Centring::kNode, Centring::kCell}) {
      const bool cells = centring == Centring::kCell;
      if (zones[cells] == 0) continue;
      GridScalar scalar;
      scalar.name = data.variables[n];
      if (zones[0] > 0 && zones[1] > 0) scalar.name += cells ? ":cell" : ":node";
      const auto taken = [&](const GridScalar& other) { return other.name == scalar.name; };
      if (std::any_of(description.scalars.begin(), description.scalars.end(), taken))
        scalar.name += fmt::format(":{}", n + 1);
      scalar.aliases = {nameAlone(data.variables[n])};
      scalar.centring = centring;
      description.scalars.push_back(std::move(scalar));
      variables.push_back(n);
    }
  }
}

std::unique_ptr<DataSource> openTecplot(const OpenGridOptions& options) {
  TecplotGrid grid(options);
  if (grid.data.zones[0].elements > 0) return std::make_unique<TecplotMeshSource>(std::move(grid));
  return std::make_unique<TecplotSource>(std::move(grid));
}

TecplotMeshSource::TecplotMeshSource(TecplotGrid grid) : grid_(std::move(grid)) {}

void TecplotMeshSource::readScalars(const TecplotZone& zone, uint64_t first, uint64_t count,
                                    std::span<const uint32_t> scalars,
                                    std::vector<std::vector<float>>& out) const {
  out.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    out[n].assign(count, std::numeric_limits<float>::quiet_NaN());
    const TecplotValues& values = zone.values[grid_.variables.at(scalars[n])];
    if (!values.passive && values.centring == grid_.description.scalars[scalars[n]].centring)
      readTecplotValues(values, first, std::span(out[n]));
  }
}

void TecplotMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                   std::span<const uint32_t> scalars, MeshPoints& out) const {
  const TecplotZone& zone = grid_.data.zones.at(piece);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(count);
    readTecplotValues(zone.values[grid_.axes[axis]], first, std::span(*axes[axis]));
  }
  out.hidden.assign(count, 0);
  readScalars(zone, first, count, scalars, out.scalars);
}

/// A brick whose nodes coincide is a wedge, a pyramid or a tetrahedron: a degenerate hexahedron, which has its volume.
void TecplotMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                                  std::span<const uint32_t> scalars, MeshCells& out) const {
  const TecplotZone& zone = grid_.data.zones.at(piece);
  const uint64_t each = zone.element_nodes;
  std::vector<double> numbers(count * each);
  readTecplotValues(zone.connectivity, first * each, std::span(numbers));
  std::vector<uint64_t> nodes(each);
  out.clear();
  for (uint64_t n = 0; n < count; ++n) {
    for (uint64_t node = 0; node < each; ++node) {
      const double number = numbers[n * each + node] - static_cast<double>(zone.first_node);
      nodes[node] = number >= 0 && number < 0x1p53 ? static_cast<uint64_t>(number)
                                                   : std::numeric_limits<uint64_t>::max();
    }
    out.append(each == 4 ? CellKind::kTetrahedron : CellKind::kHexahedron, nodes);
  }
  readScalars(zone, first, count, scalars, out.scalars);
}

TecplotSource::TecplotSource(TecplotGrid grid) : grid_(std::move(grid)) {}

/// Values of cells go to their lowest nodes; the other elements of `to` are left.
template <typename Value>
void TecplotSource::readBox(const TecplotZone& zone, size_t variable, const NodeBox& box,
                            std::vector<Value>& to) const {
  const TecplotValues& values = zone.values[variable];
  const uint64_t less = values.centring == Centring::kCell ? 1 : 0;
  const uint64_t ni = zone.nodes[0], row = box.rowNodes(ni), rows = box.j1 - box.j0;
  const uint64_t end = std::min(box.endOfRow(ni), ni - less);
  const uint64_t j1 = std::min(box.j1, zone.nodes[1] - less), k1 = std::min(box.k1, zone.nodes[2] - less);
  if (box.j0 >= j1 || box.i0 >= end) return;
  const uint64_t along = end - box.i0;
  for (uint64_t k = box.k0; k < k1; ++k) {
    const uint64_t first = values.row_pitch * (box.j0 + values.columns * k) + box.i0,
                   at = row * rows * (k - box.k0);
    if (along == ni && values.row_pitch == ni) {
      readTecplotValues(values, first, std::span(to).subspan(at, ni * (j1 - box.j0)));
      continue;
    }
    for (uint64_t j = 0; j < j1 - box.j0; ++j)
      readTecplotValues(values, first + values.row_pitch * j, std::span(to).subspan(at + row * j, along));
  }
}

void TecplotSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                         NodeArrays& out) const {
  const TecplotZone& zone = grid_.data.zones.at(block);
  const size_t nodes = box.rowNodes(zone.nodes[0]) * (box.j1 - box.j0) * (box.k1 - box.k0);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(nodes);
    readBox(zone, grid_.axes[axis], box, *axes[axis]);
  }
  out.blank.assign(nodes, 0);
  if (grid_.description.blocks[block].has_blanking) {
    std::vector<float> iblank(nodes);
    readBox(zone, *grid_.iblank, box, iblank);
    std::transform(iblank.begin(), iblank.end(), out.blank.begin(),
                   [](float value) { return static_cast<uint8_t>(value == 0); });
  }
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    out.scalars[n].assign(nodes, std::numeric_limits<float>::quiet_NaN());
    const size_t variable = grid_.variables.at(scalars[n]);
    const TecplotValues& values = zone.values[variable];
    if (!values.passive && values.centring == grid_.description.scalars[scalars[n]].centring)
      readBox(zone, variable, box, out.scalars[n]);
  }
}

bool TecplotSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  if (!grid_.description.blocks.at(block).has_blanking) return false;
  const TecplotZone& zone = grid_.data.zones[block];
  std::vector<float> iblank(zone.nodes[0] * (box.j1 - box.j0) * (box.k1 - box.k0));
  readBox(zone, *grid_.iblank, box, iblank);
  out.resize(iblank.size());
  std::transform(iblank.begin(), iblank.end(), out.begin(),
                 [](float value) { return static_cast<uint8_t>(value < 0); });
  return true;
}

}  // namespace curvisplat
