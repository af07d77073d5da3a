// Reads boxes of nodes and of cells of a VTK piece.
#pragma once

#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Half-open ranges of indices, relative to the piece's first node or cell.
struct VtkBox {
  std::array<uint64_t, 3> lower{}, upper{};
  uint64_t along(size_t axis) const { return upper[axis] - lower[axis]; }
  uint64_t size() const { return along(0) * along(1) * along(2); }
};

/// The nodes of `box` of `block` as a box of its piece.
VtkBox nodesOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box);
/// The cells of `block` whose lowest nodes are in `box`, as a box of its piece; may be empty.
VtkBox cellsOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box);

/// Reads a box of an array of `counts` tuples along i, j and k; each wanted component goes to its
/// to[0 .. box.size()), i fastest.
template <typename Value>
void readBox(const VtkArray& array, const std::array<uint64_t, 3>& counts, const VtkBox& box,
             std::span<const WantedComponent<Value>> wanted);

/// The piece's nodes, or cells, along i, j and k.
std::array<uint64_t, 3> nodeCounts(const VtkPiece& piece);
std::array<uint64_t, 3> cellCounts(const VtkPiece& piece);

/// Overwrites x, y, z, which have box.size() values each.
void readNodes(const VtkPiece& piece, const VtkBox& box, NodeArrays& out);
/// Overwrites blank, which has box.size() values.
void readBlank(const VtkPiece& piece, const VtkBox& box, std::span<uint8_t> blank);
/// Sets `values`, of the cells of `box`, to NaN where vtkGhostType hides the cell or a finer patch covers it.
void blankHiddenCells(const VtkPiece& piece, const VtkBox& box, std::span<float> values);

}  // namespace curvisplat
