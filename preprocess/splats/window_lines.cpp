#include "preprocess/splats/window_lines.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

/// The rows of `window` that the splats of `box` may depend on.
NodeBox rowsAround(const NodeBox& box, const NodeBox& window) {
  constexpr uint64_t kReach = kStretchReach;
  return {std::max(window.j0, box.j0 - std::min(box.j0, kReach)), std::min(window.j1, box.j1 + kReach),
          std::max(window.k0, box.k0 - std::min(box.k0, kReach)), std::min(window.k1, box.k1 + kReach)};
}

}  // namespace

WindowLines::WindowLines(const BlockWindow& in, const NodeBox& box, StretchFit fit, bool by_widths,
                         NodeScratch& scratch)
    : in_(in),
      near_(rowsAround(box, in.window)),
      lattice_{in.nodes->x.data(), in.nodes->y.data(), in.nodes->z.data(), in.nodes->blank.data()},
      ni_(in.block.ni),
      i0_(in.i0),
      i1_(in.endOfPart(in.block.ni)),
      row_stride_(static_cast<ptrdiff_t>(in.window.rowNodes(ni_))),
      plane_stride_(row_stride_ * static_cast<ptrdiff_t>(in.window.j1 - in.window.j0)),
      strides_{1, row_stride_, plane_stride_},
      fit_(fit),
      by_widths_(by_widths),
      scratch_(scratch) {
  for (auto& row : scratch.stretch) row.assign(i1_ - i0_, 1.0f);
  for (auto* rows : {&scratch.growth, &scratch.drift})
    for (auto& row : *rows) row.assign(i1_ - i0_, 0.0f);
  for (auto& row : scratch.lines) row.resize(i1_ - i0_);
  scratch.near_blank.resize(i1_ - i0_);
  findBlanks();
}

void WindowLines::findBlanks() {
  const NodeBox& window = in_.window;
  const uint64_t first = std::max(window.i0, i0_ - std::min<uint64_t>(i0_, kStretchReach));
  const uint64_t count = std::min(i1_ + kStretchReach, window.endOfRow(ni_)) - first;
  scratch_.has_blank.clear();
  for (uint64_t k = near_.k0; k < near_.k1; ++k) {
    for (uint64_t j = near_.j0; j < near_.j1; ++j) {
      const uint8_t* const blank = lattice_.blank + (elementOfRow(j, k) + static_cast<ptrdiff_t>(first));
      scratch_.has_blank.push_back(std::memchr(blank, 1, count) != nullptr);
    }
  }
}

void WindowLines::clearMarks(uint64_t first, uint64_t last) const {
  std::fill_n(scratch_.near_blank.begin() + static_cast<ptrdiff_t>(first - i0_), last - first, uint8_t{0});
}

/// Marks the nodes of a row for which those of the row at `row` are blank.
void WindowLines::markBlanks(ptrdiff_t row, uint64_t first, uint64_t last) const {
  const uint8_t* const blank = lattice_.blank + row + static_cast<ptrdiff_t>(first);
  uint8_t* const marks = scratch_.near_blank.data() + (first - i0_);
  for (uint64_t n = 0; n < last - first; ++n) marks[n] |= static_cast<uint8_t>(blank[n] != 0);
}

bool WindowLines::anyBlankAround(uint64_t j, uint64_t k) const {
  const GridBlock& block = in_.block;
  for (uint64_t row_k = k - std::min<uint64_t>(k, 1); row_k < std::min(k + 2, block.nk); ++row_k)
    for (uint64_t row_j = j - std::min<uint64_t>(j, 1); row_j < std::min(j + 2, block.nj); ++row_j)
      if (hasBlank(row_j, row_k)) return true;
  return false;
}

CellLengths WindowLines::cellsAlong(size_t axis, const std::array<uint64_t, 3>& ijk, ptrdiff_t at) const {
  const NodePositions nodes{lattice_.x, lattice_.y, lattice_.z};
  if (!by_widths_) return {nodes};
  const std::array<uint64_t, 3> count{ni_, in_.block.nj, in_.block.nk};
  const auto difference = [&](size_t other) {
    const auto neighbour = [&](bool there, ptrdiff_t step) {
      return there && !lattice_.blank[at + step] ? at + step : at;
    };
    return lattice_.position(neighbour(ijk[other] + 1 < count[other], strides_[other])) -
           lattice_.position(neighbour(ijk[other] > 0, -strides_[other]));
  };
  return {nodes, glm::cross(difference((axis + 1) % 3), difference((axis + 2) % 3))};
}

WindowLines::InnerPart WindowLines::innerPart(size_t axis, uint64_t j, uint64_t k) const {
  const auto is_inner = [](uint64_t index, uint64_t count, uint64_t reach) {
    return index >= reach && index + reach < count;
  };
  const uint64_t of_i = reach(0, axis), of_j = reach(1, axis), of_k = reach(2, axis);
  if (!is_inner(j, in_.block.nj, of_j) || !is_inner(k, in_.block.nk, of_k)) return {i1_, i1_, false};
  InnerPart part{std::min(i1_, std::max(of_i, i0_)), 0, false};
  part.last = std::max(part.first, std::min(ni_ - std::min(ni_, of_i), i1_));
  for (uint64_t row_k = k - of_k; row_k <= k + of_k; ++row_k)
    for (uint64_t row_j = j - of_j; row_j <= j + of_j; ++row_j)
      part.any_blank |= (row_j == j || row_k == k) && hasBlank(row_j, row_k);
  return part;
}

void WindowLines::markBlanksAlong(size_t axis, ptrdiff_t row, uint64_t first, uint64_t last) const {
  clearMarks(first, last);
  for (size_t along = 0; along < 3; ++along) {
    const auto most = static_cast<ptrdiff_t>(reach(along, axis));
    for (ptrdiff_t n = -most; n <= most; ++n) markBlanks(row + n * strides_[along], first, last);
  }
}

void WindowLines::stretchRow(uint64_t j, uint64_t k) const {
  const ptrdiff_t row = elementOfRow(j, k);
  const std::array<uint64_t, 3> count{ni_, in_.block.nj, in_.block.nk};
  for (size_t axis = 0; axis < 3; ++axis) {
    float *out = scratch_.stretch[axis].data(), *growth = scratch_.growth[axis].data(),
          *drift = scratch_.drift[axis].data();
    const auto one_by_one = [&](uint64_t begin, uint64_t end) {
      for (uint64_t i = begin; i < end; ++i) {
        const ptrdiff_t at = row + static_cast<ptrdiff_t>(i);
        if (lattice_.blank[at]) continue;
        const std::array<uint64_t, 3> ijk{i, j, k};
        const NodeOnLine node = onLine(at, strides_[axis], ijk[axis], count[axis]);
        const CellLengths cells = cellsAlong(axis, ijk, at);
        const SquaredExtents extents = extentsOnLine(cells, at, node.stride, node.before, node.after);
        const bool has_two = node.before + node.after == 1;
        const Stretch stretch = has_two ? Stretch() : stretchOf(extents, fit_);
        if (isAtJoint(node.index, node.count)) scratch_.lines[axis][i - i0_] = lineOf(node, cells, extents);
        out[i - i0_] = stretch.factor;
        growth[i - i0_] = stretch.growth;
        drift[i - i0_] = stretch.drift;
      }
    };
    const auto at_once = [&](uint64_t begin, uint64_t end) {
      if (begin >= end) return;
      NodeRow nodes{{lattice_.x, lattice_.y, lattice_.z},
                    row + static_cast<ptrdiff_t>(begin),
                    strides_[axis],
                    end - begin};
      if (by_widths_) nodes.across = {strides_[(axis + 1) % 3], strides_[(axis + 2) % 3]};
      stretchNodes(nodes, {out + (begin - i0_), growth + (begin - i0_), drift + (begin - i0_)}, fit_);
    };
    // Nodes with neighbours in the block are done several at once, as far as none of these is blank.
    const auto [first, last, any_blank] = innerPart(axis, j, k);
    one_by_one(i0_, first);
    if (!any_blank) {
      at_once(first, last);
    } else {
      markBlanksAlong(axis, row, first, last);
      forEachRun(first, last, [&](uint64_t begin, uint64_t end, bool is_clear) {
        is_clear ? at_once(begin, end) : one_by_one(begin, end);
      });
    }
    one_by_one(last, i1_);
  }
}

WindowLines::NodeOnLine WindowLines::onLine(ptrdiff_t at, ptrdiff_t stride, uint64_t index,
                                            uint64_t count) const {
  const auto neighbours = [&](uint64_t most, ptrdiff_t step) {
    int found = 0;
    while (found < kStretchReach && static_cast<uint64_t>(found) < most &&
           !lattice_.blank[at + (found + 1) * step])
      ++found;
    return found;
  };
  return {at, stride, index, count, neighbours(index, -stride), neighbours(count - 1 - index, stride)};
}

/// The line of a node; empty if the node has a neighbour on neither side, or on both sides of a face.
JointLine WindowLines::lineOf(const NodeOnLine& node, const CellLengths& cells,
                              const SquaredExtents& extents) const {
  const bool has_before = node.before > 0, has_after = node.after > 0;
  const bool is_half = isFace(node.index, node.count) && has_before != has_after;
  const int layer = layerOf(node.index, node.count);
  if (!is_half && !(layer != 0 && has_before && has_after)) return {};
  SquaredExtents row = extents;
  if (is_half ? has_before : layer < 0) std::reverse(row.begin(), row.end());
  const ptrdiff_t from = node.at - (has_before ? node.stride : 0),
                  to = node.at + (has_after ? node.stride : 0);
  const double extent = glm::length(lattice_.position(to) - lattice_.position(from));
  if (const double width = cells.squared(from, to); width > 0 && by_widths_) {
    // Each cell gets the length that it would have if it were sheared as this node's: the splat's axis lies along the line.
    for (double& squared : row) squared *= extent * extent / width;
  }
  return JointLine::ofExtents(row, 0.5 * extent);
}

std::array<JointLine, 3> WindowLines::atJoints(const std::array<uint64_t, 3>& ijk) const {
  const std::array<uint64_t, 3> count{ni_, in_.block.nj, in_.block.nk};
  std::array<JointLine, 3> lines{};
  for (size_t axis = 0; axis < 3; ++axis)
    if (isAtJoint(ijk[axis], count[axis])) lines[axis] = scratch_.lines[axis][ijk[0] - i0_];
  return lines;
}

}  // namespace curvisplat
