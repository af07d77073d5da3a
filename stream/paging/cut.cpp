#include "stream/paging/cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <queue>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

ValueBounds boundsOf(const BrickVariable& variable) {
  return {variable.min, variable.max, variable.largest_slope, variable.largest_deviation};
}

/// Questions about single bricks in a view.
class BrickView {
 public:
  BrickView(const CutTree& tree, const CutView& view, const TransparentBounds& transparent,
            const CutOptions& options)
      : tree_(tree),
        view_(view),
        transparent_(transparent),
        lod_pixels_(options.lod_pixels),
        weight_(options.error_weight),
        largest_scale_(std::max({view.scale.x, view.scale.y, view.scale.z})) {}

  const Brick& brick(uint32_t id) const { return tree_.bricks[id]; }

  bool outOfImage(uint32_t id) const {
    const Brick& brick = tree_.bricks[id];
    const glm::dvec3 centre = 0.5 * view_.scale * (brick.lower + brick.upper);
    const glm::dvec3 half = 0.5 * view_.scale * (brick.upper - brick.lower);
    const double radius = brick.largest_radius * largest_scale_;
    return std::any_of(view_.planes.begin(), view_.planes.end(), [&](const CutView::Plane& plane) {
      const double nearest =
          glm::dot(plane.normal, centre) + glm::dot(glm::abs(plane.normal), half) + plane.offset;
      return nearest < -radius;
    });
  }

  /// Whether the brick and all bricks below it are transparent.
  bool transparentThroughout(uint32_t id) const { return transparent_(tree_.subtrees[id]); }
  /// Whether the brick's own splats are transparent.
  bool transparent(uint32_t id) const { return transparent_(boundsOf(tree_.variables[id])); }

  bool visible(uint32_t id) const { return !outOfImage(id) && !transparentThroughout(id); }

  double errorPixels(uint32_t id) const {
    const Brick& brick = tree_.bricks[id];
    const double error_px = brick.error * largest_scale_ * view_.pixels;
    if (!view_.perspective || error_px == 0) return error_px;
    const glm::dvec3 nearest = glm::clamp(view_.eye, view_.scale * brick.lower, view_.scale * brick.upper);
    return error_px / glm::length(view_.eye - nearest);
  }

  /// Whether the brick may stand for all below it.
  bool fineEnough(uint32_t id) const {
    if (tree_.bricks[id].isLeaf()) return true;
    const double error_px = errorPixels(id);
    return lod_pixels_ > 0 && (error_px <= lod_pixels_ || (weight_ && weight_(id) * error_px <= lod_pixels_));
  }

  /// The brick's error on the screen, capped at lod_pixels where its weight makes it fine enough.
  double shownError(uint32_t id) const {
    const double error_px = errorPixels(id);
    return error_px > lod_pixels_ && fineEnough(id) ? lod_pixels_ : error_px;
  }

  /// The octant of the brick's cell that is nearest, for orthographic views in the viewer's direction.
  int viewersOctant(uint32_t id) const {
    const Cell& cell = tree_.bricks[id].cell;
    const glm::dvec3 middle =
        view_.scale * (tree_.root.cellMin(cell) + 0.5 * tree_.root.cellSize(cell.level));
    const glm::dvec3 side = view_.perspective ? view_.eye - middle : view_.towards_viewer;
    return (side.x > 0) | (side.y > 0) << 1 | (side.z > 0) << 2;
  }

  uint64_t bytes(uint32_t id) const {
    return uint64_t{tree_.bricks[id].geometry.length} + tree_.variables[id].values.length;
  }

  /// The bricks without a parent: the root, or those that it could not be split into.
  uint32_t roots() const {
    uint32_t count = 0;
    while (count < tree_.bricks.size() && tree_.bricks[count].parent == kNoBrick) ++count;
    return count;
  }

 private:
  const CutTree& tree_;
  const CutView& view_;
  const TransparentBounds& transparent_;
  const double lod_pixels_;
  const std::function<double(uint32_t)>& weight_;
  const double largest_scale_;
};

/// The children of an inner brick, by octant: octant n has begin[n] .. begin[n + 1] - 1. They are in Morton
/// order, and a cell that could not be split has several.
std::array<uint32_t, 9> childrenByOctant(const BrickView& view, const Brick& brick) {
  std::array<uint32_t, 9> begin;
  uint32_t child = brick.first_child;
  const uint32_t end = child + brick.child_count;
  for (int octant = 0; octant < 8; ++octant) {
    begin[octant] = child;
    while (child < end && view.brick(child).cell.octantInParent() == octant) ++child;
  }
  begin[8] = child;
  return begin;
}

/// The octants of bricks that are replaced by their children.
class RefinedOctants {
 public:
  /// Refines all that is not fine enough.
  explicit RefinedOctants(const BrickView& view) : view_(view) {}

  /// Refines within the limits: the largest error first, of equal ones the lowest brick number.
  RefinedOctants(const BrickView& view, size_t bricks, uint64_t max_splats, uint64_t max_bytes)
      : view_(view), limited_(true), max_splats_(max_splats), max_bytes_(max_bytes), refined_(bricks) {
    for (uint32_t id = 0; id < view_.roots(); ++id) {
      if (!view_.visible(id)) continue;
      splats_ += splatsOf(id);
      bytes_ += bytesOf(id);
      enqueue(id);
    }
    while (!queue_.empty()) {
      const uint32_t id = queue_.top().brick;
      queue_.pop();
      if (!refine(id)) {
        complete_ = false;
        return;
      }
    }
  }

  bool complete() const { return complete_; }
  uint8_t refined(uint32_t id) const {
    if (limited_) return refined_[id];
    return view_.fineEnough(id) ? 0 : kAllOctants;
  }

 private:
  struct Candidate {
    double error_px;
    uint32_t brick;
    bool operator<(const Candidate& other) const {
      return error_px != other.error_px ? error_px < other.error_px : brick > other.brick;
    }
  };

  uint64_t splatsOf(uint32_t id) const { return view_.transparent(id) ? 0 : view_.brick(id).splats; }
  uint64_t bytesOf(uint32_t id) const { return view_.transparent(id) ? 0 : view_.bytes(id); }

  void enqueue(uint32_t id) {
    if (!view_.fineEnough(id)) queue_.push({view_.errorPixels(id), id});
  }

  /// Octant by octant. False if the next one's children do not fit.
  bool refine(uint32_t id) {
    const Brick& brick = view_.brick(id);
    const auto children = childrenByOctant(view_, brick);
    const bool drawn = !view_.transparent(id);
    uint64_t left = brick.splats;  // of the brick itself
    for (int octant = 0; octant < 8; ++octant) {
      uint64_t splats = splats_, bytes = bytes_;
      if (drawn && brick.octant_splats[octant] > 0) {
        splats -= brick.octant_splats[octant];
        left -= brick.octant_splats[octant];
        if (left == 0) bytes -= view_.bytes(id);
      }
      visible_.clear();
      for (uint32_t child = children[octant]; child < children[octant + 1]; ++child) {
        if (!view_.visible(child)) continue;
        visible_.push_back(child);
        splats += splatsOf(child);
        bytes += bytesOf(child);
      }
      if (splats > max_splats_ || bytes > max_bytes_) return false;
      splats_ = splats;
      bytes_ = bytes;
      refined_[id] |= static_cast<uint8_t>(1 << octant);
      for (const uint32_t child : visible_) enqueue(child);
    }
    return true;
  }

  const BrickView& view_;
  const bool limited_ = false;
  bool complete_ = true;
  const uint64_t max_splats_ = 0, max_bytes_ = 0;
  std::vector<uint8_t> refined_;  // [brick]
  std::priority_queue<Candidate> queue_;
  uint64_t splats_ = 0, bytes_ = 0;  // of the cut, as far as it is refined
  std::vector<uint32_t> visible_;    // children of one octant
};

/// One walk down the octree, farthest first.
class CutWalk {
 public:
  CutWalk(const BrickView& view, const RefinedOctants& refinement) : view_(view), refinement_(refinement) {}

  Cut walk() {
    for (uint32_t id = 0; id < view_.roots(); ++id) visit(id);
    return std::move(cut_);
  }

 private:
  void visit(uint32_t id) {
    if (view_.outOfImage(id)) {
      ++cut_.out_of_image;
    } else if (view_.transparentThroughout(id)) {
      ++cut_.transparent;
    } else if (const uint8_t refined = refinement_.refined(id); refined == kAllOctants) {
      visitOctants(id, refined, false);
    } else if (view_.transparent(id)) {
      ++cut_.transparent;
      visitOctants(id, refined, false);
    } else if (refined == 0) {
      add({id, kAllOctants});
    } else {
      visitOctants(id, refined, true);
    }
  }

  /// A child can be hidden only by one that is on the viewer's side along every axis in which they differ.
  /// Counting those axes as bits, that one has the lower number. Octants that are not refined are drawn from
  /// the brick itself, as one part.
  void visitOctants(uint32_t id, uint8_t refined, bool draw_others) {
    const Brick& brick = view_.brick(id);
    const auto children = childrenByOctant(view_, brick);
    const int viewers_octant = view_.viewersOctant(id);
    uint8_t pending = 0;
    for (int farness = 7; farness >= 0; --farness) {
      const int octant = farness ^ viewers_octant;
      if (refined >> octant & 1) {
        for (uint32_t child = children[octant]; child < children[octant + 1]; ++child) visit(child);
      } else if (draw_others && brick.octant_splats[octant] > 0) {
        pending |= static_cast<uint8_t>(1 << octant);
      }
    }
    if (pending == 0) return;
    add({id, pending});
  }

  void add(const BrickPart& part) {
    cut_.parts.push_back(part);
    const Brick& brick = view_.brick(part.brick);
    cut_.splats += SplatRanges(brick, part.octants).splats();
    cut_.bytes += view_.bytes(part.brick);
    cut_.deepest_level = std::max(cut_.deepest_level, brick.cell.level);
    cut_.largest_error_px = std::max(cut_.largest_error_px, view_.shownError(part.brick));
  }

  const BrickView& view_;
  const RefinedOctants& refinement_;
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

Cut chooseCut(const CutTree& tree, const CutView& view, const TransparentBounds& transparent,
              const CutOptions& options) {
  CURVISPLAT_CHECK_OP(tree.bricks.size(), ==, tree.variables.size());
  CURVISPLAT_CHECK_OP(tree.bricks.size(), ==, tree.subtrees.size());
  const BrickView bricks(tree, view, transparent, options);
  const bool limited =
      options.max_splats != CutOptions::kNoLimit || options.max_bytes != CutOptions::kNoLimit;
  const RefinedOctants refinement =
      limited ? RefinedOctants(bricks, tree.bricks.size(), options.max_splats, options.max_bytes)
              : RefinedOctants(bricks);
  Cut cut = CutWalk(bricks, refinement).walk();
  cut.complete = refinement.complete();
  return cut;
}

}  // namespace curvisplat
