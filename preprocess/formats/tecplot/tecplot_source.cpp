#include "preprocess/formats/tecplot/tecplot_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/formats/common/block_source.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/tecplot/tecplot_data.h"
#include "preprocess/formats/tecplot/tecplot_polyhedra.h"
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

/// The zones that are drawn: all ordered, or all of finite elements.
struct TecplotGrid {
  /// Throws Error.
  explicit TecplotGrid(const OpenGridOptions& options);

  bool isMesh() const { return data.zones[0].elements > 0; }

  TecplotData data;
  GridDescription description;
  std::array<size_t, 3> axes{};
  std::optional<size_t> iblank;
  std::vector<size_t> variables;  // [description.scalars]

 private:
  void chooseStep(const OpenGridOptions& options);
  void leaveOutZones();
  void findCoordinates();
  void addScalars();
  std::optional<size_t> variableNamed(std::span<const char* const> names) const;
};

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
  description.format = fmt::format("Tecplot, {}, {}", data.encoding,
                                   countText(data.zones.size(), isMesh() ? "zone" : "ordered zone"));
  if (isMesh()) description.format += " of finite elements";
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
  if (iblank && (isMesh() || std::any_of(data.zones.begin(), data.zones.end(), of_cells))) iblank.reset();
  if (iblank) description.blanking = "iblank 0";
}

void TecplotGrid::addScalars() {
  ScalarList list(description);
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
      std::string name = data.variables[n];
      if (zones[0] > 0 && zones[1] > 0) name += cells ? ":cell" : ":node";
      list.add({name, fmt::format("{}:{}", name, n + 1)}, centring).aliases = {nameAlone(data.variables[n])};
      variables.push_back(n);
    }
  }
}

void readNodes(const TecplotGrid& grid, size_t zone, uint64_t first, uint64_t count, const Places& to) {
  for (size_t axis = 0; axis < 3; ++axis)
    readTecplotValues(grid.data.zones.at(zone).values[grid.axes[axis]], first, to.span(axis, count));
}

/// Null where the zone does not have the scalar.
const TecplotValues* tecplotValues(const TecplotGrid& grid, size_t zone, size_t scalar) {
  const TecplotValues& values = grid.data.zones.at(zone).values[grid.variables.at(scalar)];
  const bool has = !values.passive && values.centring == grid.description.scalars[scalar].centring;
  return has ? &values : nullptr;
}

BlockArray<float*> arrayOf(const TecplotValues& values) {
  const auto run = [&values](uint64_t first, uint64_t count, float* to) {
    readTecplotValues(values, first, std::span(to, count));
  };
  return {run, {values.row_pitch, values.columns}};
}

class TecplotBlocks final : public BlockSource {
 public:
  explicit TecplotBlocks(TecplotGrid grid) : grid_(std::move(grid)) {
    description_ = grid_.description;
    negative_is_fringe_ = true;
  }

 private:
  BlockArray<Places> nodesOf(uint32_t block) const override {
    return [this, block](uint64_t first, uint64_t count, const Places& to) {
      readNodes(grid_, block, first, count, to);
    };
  }
  BlockArray<float*> iblankOf(uint32_t block) const override {
    return arrayOf(grid_.data.zones[block].values[*grid_.iblank]);
  }
  BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const override {
    const TecplotValues* const values = tecplotValues(grid_, block, scalar);
    return values ? arrayOf(*values) : BlockArray<float*>();
  }

  const TecplotGrid grid_;
};

class TecplotMesh final : public ElementSource {
 public:
  TecplotMesh(TecplotGrid grid, const std::filesystem::path& temporary_folder) : grid_(std::move(grid)) {
    description_ = grid_.description;
    const ListSpools spools(temporary_folder);
    for (size_t n = 0; n < grid_.data.zones.size(); ++n) {
      const TecplotZone& zone = grid_.data.zones[n];
      polyhedra_.push_back(
          zone.of_faces ? std::make_unique<const TecplotPolyhedra>(
                              zone, fmt::format("{}: {}", description_.files[0], zone.describe(n)), spools)
                        : nullptr);
    }
  }

 private:
  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override {
    readNodes(grid_, piece, first, count, to);
  }
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override;
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override {
    if (const TecplotValues* const values = tecplotValues(grid_, piece, scalar))
      readTecplotValues(*values, first, to);
  }

  const TecplotGrid grid_;
  std::vector<std::unique_ptr<const TecplotPolyhedra>> polyhedra_;  // [zone]; null of other elements
};

/// A brick whose nodes coincide is a wedge, a pyramid or a tetrahedron: a degenerate hexahedron, which has its volume.
void TecplotMesh::appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const {
  const TecplotZone& zone = grid_.data.zones.at(piece);
  if (zone.of_faces) return polyhedra_[piece]->append(first, count, out);
  const uint64_t each = zone.element_nodes;
  std::vector<double> numbers(count * each);
  readTecplotValues(zone.connectivity, first * each, std::span(numbers));
  std::vector<uint64_t> nodes(each);
  for (uint64_t n = 0; n < count; ++n) {
    for (uint64_t node = 0; node < each; ++node)
      nodes[node] = pointNumber(numbers[n * each + node], static_cast<double>(zone.first_node));
    out.append(each == 4 ? CellKind::kTetrahedron : CellKind::kHexahedron, nodes);
  }
}

}  // namespace

bool isTecplot(const InputFile& file) {
  return isTecplotBinary(file) || isTecplotText(file);
}

std::unique_ptr<DataSource> openTecplot(const OpenGridOptions& options) {
  TecplotGrid grid(options);
  if (grid.isMesh()) return std::make_unique<TecplotMesh>(std::move(grid), options.temporary_folder);
  return std::make_unique<TecplotBlocks>(std::move(grid));
}

}  // namespace curvisplat
