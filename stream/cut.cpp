#include "stream/cut.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "stream/error.h"

namespace curvisplat {
namespace {

ValueBounds boundsOf(const BrickVariable& variable) {
  return {variable.min, variable.max, variable.largest_slope, variable.largest_deviation};
}

/// One walk down the octree.
class CutWalk {
 public:
  CutWalk(const RootCube& root, std::span<const Brick> bricks, std::span<const BrickVariable> variables,
          std::span<const ValueBounds> subtrees, const CutView& view, const TransparentBounds& transparent,
          double lod_pixels)
      : root_(root),
        bricks_(bricks),
        variables_(variables),
        subtrees_(subtrees),
        view_(view),
        transparent_(transparent),
        lod_pixels_(lod_pixels),
        largest_scale_(std::max({view.scale.x, view.scale.y, view.scale.z})) {}

  void visit(uint32_t id) {
    const Brick& brick = bricks_[id];
    if (outOfImage(brick)) {
      ++cut_.out_of_image;
    } else if (transparent_(subtrees_[id])) {
      ++cut_.transparent;
    } else if (brick.isLeaf() || fineEnough(brick)) {
      take(id);
    } else {
      visitChildren(brick);
    }
  }

  Cut finish() { return std::move(cut_); }

 private:
  void take(uint32_t id) {
    if (transparent_(boundsOf(variables_[id]))) {
      ++cut_.transparent;
      return;
    }
    cut_.bricks.push_back(id);
    cut_.splats += bricks_[id].splats;
    cut_.deepest_level = std::max(cut_.deepest_level, bricks_[id].cell.level);
  }

  /// A child can be hidden only by one that is on the viewer's side along every axis in which they differ.
  /// Counting those axes as bits, that one has the lower number.
  void visitChildren(const Brick& brick) {
    const int viewers_octant = viewersOctant(brick.cell);
    for (int farness = 7; farness >= 0; --farness)
      for (uint32_t child = brick.first_child; child < brick.first_child + brick.child_count; ++child)
        if (bricks_[child].cell.octantInParent() == (farness ^ viewers_octant)) visit(child);
  }

  /// The octant of `cell` that is nearest, for orthographic views in the viewer's direction.
  int viewersOctant(const Cell& cell) const {
    const glm::dvec3 middle = view_.scale * (root_.cellMin(cell) + 0.5 * root_.cellSize(cell.level));
    const glm::dvec3 side = view_.perspective ? view_.eye - middle : view_.towards_viewer;
    return (side.x > 0) | (side.y > 0) << 1 | (side.z > 0) << 2;
  }

  bool outOfImage(const Brick& brick) const {
    const glm::dvec3 centre = 0.5 * view_.scale * (brick.lower + brick.upper);
    const glm::dvec3 half = 0.5 * view_.scale * (brick.upper - brick.lower);
    const double radius = brick.largest_radius * largest_scale_;
    return std::any_of(view_.planes.begin(), view_.planes.end(), [&](const CutView::Plane& plane) {
      const double nearest =
          glm::dot(plane.normal, centre) + glm::dot(glm::abs(plane.normal), half) + plane.offset;
      return nearest < -radius;
    });
  }

  bool fineEnough(const Brick& brick) const {
    if (!(lod_pixels_ > 0)) return false;
    const double error_px = brick.error * largest_scale_ * view_.pixels;
    if (!view_.perspective) return error_px <= lod_pixels_;
    const glm::dvec3 nearest = glm::clamp(view_.eye, view_.scale * brick.lower, view_.scale * brick.upper);
    return error_px <= lod_pixels_ * glm::length(view_.eye - nearest);
  }

  const RootCube& root_;
  const std::span<const Brick> bricks_;
  const std::span<const BrickVariable> variables_;
  const std::span<const ValueBounds> subtrees_;
  const CutView& view_;
  const TransparentBounds& transparent_;
  const double lod_pixels_;
  const double largest_scale_;
  Cut cut_;
};

}  // namespace

std::vector<ValueBounds> subtreeBounds(std::span<const Brick> bricks,
                                       std::span<const BrickVariable> variables) {
  CURVISPLAT_CHECK_OP(bricks.size(), ==, variables.size());
  std::vector<ValueBounds> bounds(bricks.size());
  for (size_t id = 0; id < bricks.size(); ++id) bounds[id] = boundsOf(variables[id]);
  // Level by level: children come after their parents.
  for (size_t id = bricks.size(); id-- > 0;) {
    if (bricks[id].parent == kNoBrick) continue;
    const ValueBounds& child = bounds[id];
    ValueBounds& parent = bounds[bricks[id].parent];
    parent.min = std::min(parent.min, child.min);
    parent.max = std::max(parent.max, child.max);
    parent.largest_slope = std::max(parent.largest_slope, child.largest_slope);
    parent.largest_deviation = std::max(parent.largest_deviation, child.largest_deviation);
  }
  return bounds;
}

Cut chooseCut(const RootCube& root, std::span<const Brick> bricks, std::span<const BrickVariable> variables,
              std::span<const ValueBounds> subtrees, const CutView& view,
              const TransparentBounds& transparent, double lod_pixels) {
  CURVISPLAT_CHECK_OP(bricks.size(), ==, variables.size());
  CURVISPLAT_CHECK_OP(bricks.size(), ==, subtrees.size());
  CutWalk walk(root, bricks, variables, subtrees, view, transparent, lod_pixels);
  for (uint32_t id = 0; id < bricks.size() && bricks[id].parent == kNoBrick; ++id) walk.visit(id);
  return walk.finish();
}

}  // namespace curvisplat
