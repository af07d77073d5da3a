// The cells of a part of one block, found by position, and the sizes of cells, by which overlapping blocks
// are compared. About 50 bytes a node of the grid. A tree is immutable: any thread may ask.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {

/// A cell's volume in quarters of a power of two: coarse enough that cells of the same size compare equal,
/// whatever their rounding.
using CellSize = int16_t;
inline constexpr CellSize kNoCell = std::numeric_limits<CellSize>::max();

/// A cell without volume is the smallest; one that is not finite, or kNoCell, is none. The limits between
/// sizes are off the volumes that grids of round numbers have.
inline CellSize cellSize(const std::array<glm::dvec3, 8>& corners) {
  constexpr double kOffset = 0.137;
  const double volume = std::abs(Hexahedron(corners).volume());
  if (!std::isfinite(volume)) return kNoCell;
  if (volume == 0) return std::numeric_limits<CellSize>::min();
  return static_cast<CellSize>(std::clamp(std::floor(4 * std::log2(volume) + kOffset), -32000.0, 32000.0));
}

/// A tree over the block's lattice: each node halves the longest of its three index ranges, and has the
/// bounding box of its cells. So the tree has no indices, and follows thin and curved cells, since cells
/// next to one another in the lattice are next to one another in space.
class CellTree {
 public:
  /// The tree of the cells whose lowest nodes are in the slab's box and that are there; the window has the
  /// nodes behind them (Halo{0, 1}). `loaded` as a NodeReader of scalars of this centring gives it.
  /// `fringe`: [node of the window], or empty.
  CellTree(const GridBlock& block, LoadedSlab loaded, std::vector<uint8_t> fringe, Centring centring);

  /// The box of all cells; empty if there are none.
  const BoundingBox& box() const { return box_; }
  uint64_t bytes() const;

  /// A cell that holds a point: the element of its lowest node, and the point's local coordinates in it.
  struct Holder {
    size_t cell = 0;
    glm::dvec3 u{0.0};
  };
  /// The place where a search begins: next to where the last one ended. One a thread.
  struct Hint {
    std::optional<size_t> cell;
  };

  /// Whether `visit(Holder)` is true for a cell that holds the point. A point of a common face is in all of
  /// its cells.
  template <typename Visit>
  bool anyHolder(const glm::dvec3& point, Hint& hint, const Visit& visit) const;
  /// Whether the box meets a group of some cells.
  bool meets(const BoundingBox& box) const;

  CellSize sizeOf(size_t cell) const { return sizes_[cell]; }
  CellSize smallest() const;
  /// Whether the node next to the point is one of the fringe.
  bool isFringe(const Holder& holder) const {
    return !fringe_.empty() && fringe_[holder.cell + (holder.u.x > 0) + (holder.u.y > 0) * row_stride_ +
                                       (holder.u.z > 0) * plane_stride_] != 0;
  }
  bool isAllFringe() const;

 private:
  struct Range {  // of lowest nodes, in the window
    std::array<uint32_t, 3> begin{}, end{};
    uint64_t cells() const { return uint64_t{end[0] - begin[0]} * (end[1] - begin[1]) * (end[2] - begin[2]); }
    std::array<Range, 2> halves() const;
  };
  struct Node {
    std::array<float, 3> lower, upper;  // from origin_; lower > upper: no cell
    uint32_t second = 0;                // the second child, the first being the next node; 0: a leaf
  };
  struct Visited {
    uint32_t node;
    Range range;
  };

  static constexpr uint64_t kLeafCells = 8;
  // The tolerance for a point outside of a cell that holds it, in the cell's local coordinates: on the face
  // between two cells it is in both.
  static constexpr double kOnFace = 1e-9;

  uint32_t build(const Range& range);
  size_t elementOf(uint32_t i, uint32_t j, uint32_t k) const {
    return i + j * row_stride_ + k * plane_stride_;
  }
  std::array<glm::dvec3, 8> cornersOf(size_t cell) const {
    const NodeArrays& nodes = loaded_.nodes;
    return cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), cell, row_stride_, plane_stride_);
  }
  /// Searches by way of neighbours from the hint's cell; none if it is not near, or on a face.
  std::optional<Holder> near(const glm::dvec3& point, const Hint& hint) const;
  std::optional<Holder> in(size_t cell, const glm::dvec3& point) const;
  static bool holds(const Node& node, const glm::dvec3& from_origin) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<size_t>(axis);
      if (!(node.lower[a] <= from_origin[axis] && from_origin[axis] <= node.upper[a])) return false;
    }
    return true;
  }

  LoadedSlab loaded_;
  std::vector<uint8_t> fringe_;
  size_t row_stride_, plane_stride_;
  Range all_;
  std::vector<CellSize> sizes_;  // [element of the lowest node]; kNoCell where there is none
  BoundingBox box_;
  glm::dvec3 origin_{0.0};
  std::vector<Node> nodes_;  // parents before their children
};

template <typename Visit>
bool CellTree::anyHolder(const glm::dvec3& point, Hint& hint, const Visit& visit) const {
  if (nodes_.empty() || !box_.holds(point)) return false;
  if (const std::optional<Holder> holder = near(point, hint)) {
    hint.cell = holder->cell;
    return visit(*holder);
  }
  const glm::dvec3 from_origin = point - origin_;
  std::array<Visited, 64> stack;  // a level has one more: 32-bit indices along three axes end before
  size_t depth = 0;
  stack[depth++] = {0, all_};
  while (depth > 0) {
    const Visited at = stack[--depth];
    const Node& node = nodes_[at.node];
    if (!holds(node, from_origin)) continue;
    if (node.second != 0) {
      const auto halves = at.range.halves();
      stack[depth++] = {node.second, halves[1]};
      stack[depth++] = {at.node + 1, halves[0]};
      continue;
    }
    for (uint32_t k = at.range.begin[2]; k < at.range.end[2]; ++k)
      for (uint32_t j = at.range.begin[1]; j < at.range.end[1]; ++j)
        for (uint32_t i = at.range.begin[0]; i < at.range.end[0]; ++i) {
          const std::optional<Holder> holder = in(elementOf(i, j, k), point);
          if (!holder) continue;
          hint.cell = holder->cell;
          if (visit(*holder)) return true;
        }
  }
  return false;
}

}  // namespace curvisplat
