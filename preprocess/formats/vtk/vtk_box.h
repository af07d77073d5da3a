// Reads boxes of nodes and of cells out of a VTK piece.
#pragma once

#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Half-open ranges of indices, counted from the piece's first node or cell.
struct VtkBox {
  std::array<uint64_t, 3> lower{}, upper{};
  uint64_t along(size_t axis) const { return upper[axis] - lower[axis]; }
  uint64_t size() const { return along(0) * along(1) * along(2); }
};

/// The nodes of `box` in `block`, in its piece.
VtkBox nodesOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box);
/// Those cells of `block` whose lowest nodes are in `box`; may be empty.
VtkBox cellsOf(const VtkPiece& piece, const VtkBlock& block, const NodeBox& box);

/// Reads an array of `counts` tuples along i, j and k: of each wanted component puts to[0 .. box.size()), i
/// fastest.
template <typename Value>
void readBox(const VtkArray& array, const std::array<uint64_t, 3>& counts, const VtkBox& box,
             std::span<const WantedComponent<Value>> wanted);

/// Tuples along i, j, k of the piece's arrays.
std::array<uint64_t, 3> nodeCounts(const VtkPiece& piece);
std::array<uint64_t, 3> cellCounts(const VtkPiece& piece);

/// Overwrites x, y, z, which have box.size() values each.
void readNodes(const VtkPiece& piece, const VtkBox& box, NodeArrays& out);
/// Overwrites blank, which has box.size() values.
void readBlank(const VtkPiece& piece, const VtkBox& box, std::span<uint8_t> blank);
/// NaN for cells that vtkGhostType hides. `values`: of the cells of `box`.
void blankHiddenCells(const VtkPiece& piece, const VtkBox& box, std::span<float> values);

}  // namespace curvisplat
