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

WindowLines::WindowLines(const BlockWindow& in, const NodeBox& box, StretchFit fit, NodeScratch& scratch)
    : in_(in),
      near_(rowsAround(box, in.window)),
      lattice_{in.nodes->x.data(), in.nodes->y.data(), in.nodes->z.data(), in.nodes->blank.data()},
      ni_(in.block.ni),
      i0_(in.i0),
      i1_(in.endOfPart(in.block.ni)),
      row_stride_(static_cast<ptrdiff_t>(in.window.rowNodes(ni_))),
      plane_stride_(row_stride_ * static_cast<ptrdiff_t>(in.window.j1 - in.window.j0)),
      fit_(fit),
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

void WindowLines::stretchRow(uint64_t j, uint64_t k) const {
  constexpr uint64_t kWhole = kStretchReach - 1;  // neighbours on a side that stretchNodes() needs
  const GridBlock& block = in_.block;
  const ptrdiff_t row = elementOfRow(j, k);
  const std::array<uint64_t, 3> index{0, j, k}, count{ni_, block.nj, block.nk};
  const std::array<ptrdiff_t, 3> strides{1, row_stride_, plane_stride_};
  for (size_t axis = 0; axis < 3; ++axis) {
    float *out = scratch_.stretch[axis].data(), *growth = scratch_.growth[axis].data(),
          *drift = scratch_.drift[axis].data();
    const auto one_by_one = [&](uint64_t begin, uint64_t end) {
      for (uint64_t i = begin; i < end; ++i) {
        const ptrdiff_t at = row + static_cast<ptrdiff_t>(i);
        if (lattice_.blank[at]) continue;
        const NodeOnLine node = onLine(at, strides[axis], axis == 0 ? i : index[axis], count[axis]);
        const SquaredExtents extents =
            extentsOnLine({lattice_.x, lattice_.y, lattice_.z}, at, node.stride, node.before, node.after);
        const bool has_two = node.before + node.after == 1;
        const Stretch stretch = has_two ? Stretch() : stretchOf(extents, fit_);
        if (isAtJoint(node.index, node.count)) scratch_.lines[axis][i - i0_] = lineOf(node, extents);
        out[i - i0_] = stretch.factor;
        growth[i - i0_] = stretch.growth;
        drift[i - i0_] = stretch.drift;
      }
    };
    const auto at_once = [&](uint64_t begin, uint64_t end) {
      if (begin >= end) return;
      stretchNodes({lattice_.x, lattice_.y, lattice_.z}, row + static_cast<ptrdiff_t>(begin), strides[axis],
                   end - begin, {out + (begin - i0_), growth + (begin - i0_), drift + (begin - i0_)}, fit_);
    };
    // Nodes with neighbours in the block are done several at once, as far as none of these is blank.
    uint64_t first = i0_, last = i1_;
    bool any_blank = false;
    if (axis == 0) {
      first = std::min(i1_, std::max(kWhole, i0_));
      last = std::max(first, std::min(ni_ - std::min(ni_, kWhole), i1_));
      any_blank = hasBlank(j, k);
    } else if (index[axis] >= kWhole && index[axis] + kWhole < count[axis]) {
      for (uint64_t n = 0; n <= 2 * kWhole; ++n)
        any_blank |= axis == 1 ? hasBlank(j + n - kWhole, k) : hasBlank(j, k + n - kWhole);
    } else {
      first = last;
    }
    one_by_one(i0_, first);
    if (!any_blank) {
      at_once(first, last);
    } else {
      clearMarks(first, last);
      for (ptrdiff_t n = -static_cast<ptrdiff_t>(kWhole); n <= static_cast<ptrdiff_t>(kWhole); ++n)
        markBlanks(row + n * strides[axis], first, last);
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
JointLine WindowLines::lineOf(const NodeOnLine& node, const SquaredExtents& extents) const {
  const bool has_before = node.before > 0, has_after = node.after > 0;
  const bool is_half = isFace(node.index, node.count) && has_before != has_after;
  const int layer = layerOf(node.index, node.count);
  if (!is_half && !(layer != 0 && has_before && has_after)) return {};
  SquaredExtents row = extents;
  if (is_half ? has_before : layer < 0) std::reverse(row.begin(), row.end());
  const double extent = glm::length(lattice_.position(node.at + (has_after ? node.stride : 0)) -
                                    lattice_.position(node.at - (has_before ? node.stride : 0)));
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
