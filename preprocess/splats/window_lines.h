// The grid lines through the nodes of a box of a window: how long the cells on them are, and where blanked nodes end them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "preprocess/splats/block_window.h"
#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/stretch.h"

namespace curvisplat {

/// Whether a node is on a face of its block across an axis of `count` nodes.
inline bool isFace(uint64_t index, uint64_t count) {
  return index == 0 || index + 1 == count;
}

/// The lines and stretches of a window's rows. One thread at a time. `in` and the scratch outlive it.
class WindowLines {
 public:
  /// Sets the scratch to cells that are not stretched. `by_widths`: their lengths are CellLengths, else those along the lines.
  WindowLines(const BlockWindow& in, const NodeBox& box, StretchFit fit, bool by_widths,
              NodeScratch& scratch);

  const NodeLattice& lattice() const { return lattice_; }
  /// The element of node 0 of a row: negative where the window begins beyond it.
  ptrdiff_t elementOfRow(uint64_t j, uint64_t k) const {
    return static_cast<ptrdiff_t>(k - in_.window.k0) * plane_stride_ +
           static_cast<ptrdiff_t>(j - in_.window.j0) * row_stride_ - static_cast<ptrdiff_t>(in_.window.i0);
  }
  /// Whether a node of the row's part, or one next to it, is blank; of the rows around it as well.
  bool anyBlankAround(uint64_t j, uint64_t k) const;
  /// Calls each(begin, end, is_clear) for the nodes of a row one run after the other: those that have no blank node in the cells around
  /// them, and the others. None of the nodes `first` to `last` - 1, of the row's part, is on a face of the block.
  template <typename Each>
  void forEachRunBetweenBlanks(uint64_t j, uint64_t k, uint64_t first, uint64_t last,
                               const Each& each) const {
    clearMarks(first, last);
    const ptrdiff_t row = elementOfRow(j, k);
    for (const ptrdiff_t plane : {-plane_stride_, ptrdiff_t{0}, plane_stride_})
      for (const ptrdiff_t beside : {plane - row_stride_, plane, plane + row_stride_})
        for (const ptrdiff_t step : {beside - 1, beside, beside + 1}) markBlanks(row + step, first, last);
    forEachRun(first, last, each);
  }
  /// Fills the scratch with the stretch of the nodes of a row's part, and with their lines.
  void stretchRow(uint64_t j, uint64_t k) const;
  /// The lines, at a node of the row, across the faces of the block that it is on, or one away from. Call it
  /// after stretchRow().
  std::array<JointLine, 3> atJoints(const std::array<uint64_t, 3>& ijk) const;

 private:
  /// A node that is there, number `index` of `count` along an axis.
  struct NodeOnLine {
    ptrdiff_t at, stride;
    uint64_t index, count;
    int before, after;  // neighbours in a row, kStretchReach at the most
  };
  bool hasBlank(uint64_t j, uint64_t k) const {
    return scratch_.has_blank[(k - near_.k0) * (near_.j1 - near_.j0) + (j - near_.j0)] != 0;
  }
  void findBlanks();
  void clearMarks(uint64_t first, uint64_t last) const;
  void markBlanks(ptrdiff_t row, uint64_t first, uint64_t last) const;
  template <typename Each>
  void forEachRun(uint64_t first, uint64_t last, const Each& each) const {
    const auto marks = [&](uint64_t i) {
      return scratch_.near_blank.begin() + static_cast<ptrdiff_t>(i - i0_);
    };
    for (uint64_t begin = first; begin < last;) {
      const uint8_t mark = *marks(begin);
      const auto next = std::find(marks(begin), marks(last), static_cast<uint8_t>(1 - mark));
      const uint64_t end = i0_ + static_cast<uint64_t>(next - scratch_.near_blank.begin());
      each(begin, end, mark == 0);
      begin = end;
    }
  }
  bool isAtJoint(uint64_t index, uint64_t count) const {
    return isFace(index, count) || layerOf(index, count) != 0;
  }
  JointLine lineOf(const NodeOnLine& node, const CellLengths& cells, const SquaredExtents& extents) const;
  /// The cells along an axis around node (i, j, k), at element `at`.
  CellLengths cellsAlong(size_t axis, const std::array<uint64_t, 3>& ijk, ptrdiff_t at) const;
  /// Finds the nodes of a row that have all that stretchNodes() needs of the block: `first` to `last` - 1, if no blank node is near.
  struct InnerPart {
    uint64_t first, last;
    bool any_blank;
  };
  InnerPart innerPart(size_t axis, uint64_t j, uint64_t k) const;
  /// The neighbours on a side, along one of the axes, that stretchNodes() needs for the cells along `axis`.
  uint64_t reach(size_t along, size_t axis) const {
    return along == axis ? kStretchReach - 1 : by_widths_ ? 1 : 0;
  }
  /// Marks the nodes for which one of those that stretchNodes() needs is blank.
  void markBlanksAlong(size_t axis, ptrdiff_t row, uint64_t first, uint64_t last) const;
  NodeOnLine onLine(ptrdiff_t at, ptrdiff_t stride, uint64_t index, uint64_t count) const;

  const BlockWindow& in_;
  const NodeBox near_;  // the rows that the splats of the box may depend on
  const NodeLattice lattice_;
  uint64_t ni_, i0_, i1_;  // of a row; its part
  ptrdiff_t row_stride_, plane_stride_;
  const std::array<ptrdiff_t, 3> strides_;
  const StretchFit fit_;
  const bool by_widths_;
  NodeScratch& scratch_;
};

}  // namespace curvisplat
