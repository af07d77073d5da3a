#include "preprocess/formats/vtk/vtk_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "preprocess/formats/vtk/vtk_box.h"
#include "preprocess/formats/vtk/vtk_description.h"
#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

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
  describeFiles(grid_, description_);
  addBlocks();
  std::vector<size_t> pieces;
  for (const VtkBlock& block : grid_.blocks) pieces.push_back(block.piece);
  fields_.describe(grid_.pieces, pieces, description_);
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
    description_.blocks.push_back(
        {block.name, block.extent.nodesAlong(0), block.extent.nodesAlong(1), block.extent.nodesAlong(2),
         piece.point_ghosts || piece.cell_ghosts || piece.visible || !piece.refined.empty()});
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

void VtkSource::readField(const VtkFields::Field& field, const VtkBlock& block, const NodeBox& box,
                          std::span<const WantedComponent<float>> wanted, size_t nodes) const {
  const VtkPiece& piece = grid_.pieces[block.piece];
  const VtkArray* const found = VtkFields::arrayOf(field, grid_.pieces, block.piece);
  if (!found) {
    for (const WantedComponent<float>& component : wanted) std::fill_n(component.to, nodes, kNaN);
    return;
  }
  const VtkArray& array = *found;
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

void VtkSource::read(uint32_t block_number, const NodeBox& box, std::span<const uint32_t> scalars,
                     NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block_number, <, grid_.blocks.size());
  const VtkBlock& block = grid_.blocks[block_number];
  const VtkPiece& piece = grid_.pieces[block.piece];
  const VtkBox nodes_box = nodesOf(piece, block, box);
  const auto nodes = static_cast<size_t>(nodes_box.size());
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  readNodes(piece, nodes_box, out);
  out.blank.resize(nodes);
  readBlank(piece, nodes_box, out.blank);

  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(nodes);
  fields_.forEachWanted(scalars, out.scalars, [&](const VtkFields::Field& field, const auto& wanted) {
    readField(field, block, box, wanted, nodes);
  });
}

}  // namespace curvisplat
