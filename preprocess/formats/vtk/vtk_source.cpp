#include "preprocess/formats/vtk/vtk_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>

#include "preprocess/formats/vtk/vtk_box.h"
#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr int kMagnitude = WantedComponent<float>::kMagnitude;

const std::vector<VtkArray>& dataOf(const VtkPiece& piece, Centring centring) {
  return centring == Centring::kNode ? piece.point_data : piece.cell_data;
}

/// The name in the form that scalarsNamed() compares.
std::string asAlias(const std::string& name) {
  std::string alias;
  for (const char c : name)
    if (c != ' ' && c != '_' && c != '-')
      alias += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return alias;
}

int coordinateBytes(const VtkPiece& piece) {
  if (const auto* points = std::get_if<VtkPoints>(&piece.nodes)) return bytesOf(points->type) == 8 ? 8 : 4;
  if (const auto* axes = std::get_if<VtkAxes>(&piece.nodes))
    return std::any_of(axes->begin(), axes->end(), [](const auto& a) { return bytesOf(a.type) == 8; }) ? 8
                                                                                                       : 4;
  return 8;
}

/// Moves the values of cells from the front of `values` to their lowest nodes, and writes NaN at nodes that
/// are not the lowest node of a cell.
void spreadToNodes(const VtkBox& cells, const VtkBox& nodes, std::span<float> values) {
  const uint64_t row = nodes.along(0);
  for (uint64_t k = nodes.along(2); k-- > 0;)
    for (uint64_t j = nodes.along(1); j-- > 0;) {
      float* const to = values.data() + (k * nodes.along(1) + j) * row;
      uint64_t there = 0;
      if (k < cells.along(2) && j < cells.along(1)) {
        there = cells.along(0);
        const float* const from = values.data() + (k * cells.along(1) + j) * there;
        std::copy_backward(from, from + there, to + there);
      }
      std::fill(to + there, to + row, kNaN);
    }
}

}  // namespace

void addDataArray(VtkPiece& piece, bool of_cells, VtkArray array, std::vector<std::string>& warnings) {
  if (array.name == "vtkGhostLevels") return;
  if (array.name == "vtkGhostType" && array.components == 1 && bytesOf(array.type) == 1) {
    (of_cells ? piece.cell_ghosts : piece.point_ghosts) = std::move(array);
    return;
  }
  std::vector<VtkArray>& data = of_cells ? piece.cell_data : piece.point_data;
  const bool known =
      std::any_of(data.begin(), data.end(), [&](const VtkArray& other) { return other.name == array.name; });
  if (known)
    warnings.push_back(
        fmt::format("a second array {} of the {} is ignored", array.name, of_cells ? "cells" : "points"));
  else
    data.push_back(std::move(array));
}

VtkSource::VtkSource(VtkGrid grid) : grid_(std::move(grid)) {
  description_.format = grid_.format;
  description_.files = grid_.files;
  description_.times = grid_.times;
  description_.time_step = grid_.time_step;
  for (std::string& warning : grid_.warnings)  // many pieces may give the same warning
    if (std::find(description_.warnings.begin(), description_.warnings.end(), warning) ==
        description_.warnings.end())
      description_.warnings.push_back(std::move(warning));
  addBlocks();
  addFields(Centring::kNode);
  addFields(Centring::kCell);
  for (size_t n = 0; n < fields_.size(); ++n) addScalars(fields_[n], n);
  warnOfPartialFields();
}

void VtkSource::addBlocks() {
  std::vector<VtkBlock> blocks;
  std::string flat;
  for (VtkBlock& block : grid_.blocks) {
    if (block.extent.isFlat()) {
      if (flat.empty()) flat = fmt::format("{} ({} nodes)", block.name, block.extent.describe());
      continue;
    }
    const VtkPiece& piece = grid_.pieces[block.piece];
    description_.blocks.push_back({block.name, block.extent.nodesAlong(0), block.extent.nodesAlong(1),
                                   block.extent.nodesAlong(2),
                                   piece.point_ghosts || piece.cell_ghosts || piece.visible});
    description_.coordinate_bytes = blocks.empty()
                                        ? coordinateBytes(piece)
                                        : std::min(description_.coordinate_bytes, coordinateBytes(piece));
    blocks.push_back(std::move(block));
  }
  const std::string file = grid_.files.empty() ? "" : grid_.files.front();
  if (blocks.empty())
    throw Error("{}: has no block with volume{}; expected a three-dimensional structured grid", file,
                flat.empty() ? "" : ": " + flat + " is flat");
  if (blocks.size() < grid_.blocks.size())
    description_.warnings.push_back(fmt::format("{} of {} blocks are flat and left out, such as {}",
                                                grid_.blocks.size() - blocks.size(), grid_.blocks.size(),
                                                flat));
  grid_.blocks = std::move(blocks);
}

size_t VtkSource::fieldOf(const VtkArray& array, Centring centring) {
  const auto same = [&](const Field& field) {
    return field.name == array.name && field.centring == centring && field.components == array.components;
  };
  const auto found = std::find_if(fields_.begin(), fields_.end(), same);
  if (found != fields_.end()) return static_cast<size_t>(found - fields_.begin());
  fields_.push_back({array.name, centring, array.components, std::vector<int32_t>(grid_.pieces.size(), -1)});
  return fields_.size() - 1;
}

void VtkSource::addFields(Centring centring) {
  const size_t before = fields_.size();
  std::string active;
  for (const VtkBlock& block : grid_.blocks) {
    const VtkPiece& piece = grid_.pieces[block.piece];
    const std::vector<VtkArray>& data = dataOf(piece, centring);
    for (size_t n = 0; n < data.size(); ++n)
      fields_[fieldOf(data[n], centring)].array_of_piece[block.piece] = static_cast<int32_t>(n);
    if (active.empty())
      active = centring == Centring::kNode ? piece.active_point_data : piece.active_cell_data;
  }
  std::stable_partition(fields_.begin() + static_cast<ptrdiff_t>(before), fields_.end(),
                        [&](const Field& field) { return field.name == active; });
}

void VtkSource::addScalars(const Field& field, size_t number) {
  std::set<std::string> names;
  for (const GridScalar& scalar : description_.scalars) names.insert(scalar.name);
  std::vector<std::string> component_names;
  for (size_t piece = 0; piece < grid_.pieces.size() && component_names.empty(); ++piece)
    if (field.array_of_piece[piece] >= 0)
      component_names =
          dataOf(grid_.pieces[piece], field.centring)[static_cast<size_t>(field.array_of_piece[piece])]
              .component_names;
  const auto add = [&](const std::string& suffix, int component, std::vector<std::string> aliases) {
    GridScalar scalar;
    scalar.name = field.name + suffix;
    scalar.centring = field.centring;
    if (names.count(scalar.name)) {
      if (field.centring == Centring::kCell) scalar.name = field.name + ":cell" + suffix;
      if (names.count(scalar.name)) scalar.name += fmt::format(":{}", number);
    }
    scalar.aliases = std::move(aliases);
    description_.scalars.push_back(std::move(scalar));
    scalars_.push_back({number, component});
  };
  const auto aliasesOf = [&](uint32_t component, bool has_letter) {
    std::vector<std::string> aliases;
    const std::string begin = asAlias(field.name) + ":";
    if (has_letter) aliases.push_back(begin + std::to_string(component));
    if (component < component_names.size() && !component_names[component].empty())
      aliases.push_back(begin + asAlias(component_names[component]));
    return aliases;
  };
  if (field.components == 1) return add("", 0, {});
  const bool vector = field.components <= 3;
  if (vector) add(":mag", kMagnitude, {asAlias(field.name)});
  for (uint32_t c = 0; c < field.components; ++c)
    add(vector ? fmt::format(":{}", "xyz"[c]) : fmt::format(":{}", c), static_cast<int>(c),
        aliasesOf(c, vector));
}

void VtkSource::warnOfPartialFields() {
  for (const Field& field : fields_) {
    const auto without = std::count_if(grid_.blocks.begin(), grid_.blocks.end(), [&](const VtkBlock& block) {
      return field.array_of_piece[block.piece] < 0;
    });
    if (without > 0)
      description_.warnings.push_back(
          fmt::format("{} of {} blocks have no array {}; they are not drawn with it", without,
                      grid_.blocks.size(), field.name));
  }
}

void VtkSource::readField(const Field& field, const VtkBlock& block, const NodeBox& box,
                          std::span<const WantedComponent<float>> wanted, size_t nodes) const {
  const VtkPiece& piece = grid_.pieces[block.piece];
  const int32_t position = field.array_of_piece[block.piece];
  if (position < 0) {
    for (const WantedComponent<float>& component : wanted) std::fill_n(component.to, nodes, kNaN);
    return;
  }
  const VtkArray& array = dataOf(piece, field.centring)[static_cast<size_t>(position)];
  const VtkBox node_box = nodesOf(piece, block, box);
  if (field.centring == Centring::kNode) {
    readBox<float>(array, nodeCounts(piece), node_box, wanted);
    return;
  }
  const VtkBox cells = cellsOf(piece, block, box);
  readBox<float>(array, cellCounts(piece), cells, wanted);
  for (const WantedComponent<float>& component : wanted) {
    blankHiddenCells(piece, cells, {component.to, static_cast<size_t>(cells.size())});
    spreadToNodes(cells, node_box, {component.to, nodes});
  }
}

void VtkSource::read(uint32_t number, const NodeBox& box, std::span<const uint32_t> scalars,
                     NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(number, <, grid_.blocks.size());
  const VtkBlock& block = grid_.blocks[number];
  const VtkPiece& piece = grid_.pieces[block.piece];
  const VtkBox nodes_box = nodesOf(piece, block, box);
  const auto nodes = static_cast<size_t>(nodes_box.size());
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  readNodes(piece, nodes_box, out);
  out.blank.resize(nodes);
  readBlank(piece, nodes_box, out.blank);

  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(nodes);
  // All requested components of an array are read together.
  std::vector<bool> read(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    if (read[n]) continue;
    CURVISPLAT_CHECK_OP(scalars[n], <, scalars_.size());
    const size_t field = scalars_[scalars[n]].field;
    std::vector<WantedComponent<float>> wanted;
    for (size_t m = n; m < scalars.size(); ++m) {
      if (scalars_[scalars[m]].field != field) continue;
      wanted.push_back({scalars_[scalars[m]].component, out.scalars[m].data()});
      read[m] = true;
    }
    readField(fields_[field], block, box, wanted, nodes);
  }
}

}  // namespace curvisplat
