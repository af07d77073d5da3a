// Depths as integers: what a frame's splats are sorted by.
//
// A key depends on the splat, its brick and the view alone, and never lies outside of the range that the
// brick's box gives: whoever takes bricks in the order of those ranges knows from the index what can still
// come. A splat's key is the depth of its centre. Where a piece of a splat (at a border, or cut in
// perspective) has its centre outside of the box of its brick's centres, it takes the box's nearest or
// farthest key.
//
// Orthographic keys are the depth in the root's cube in 2^28 steps, perspective ones the bits of the distance
// from the eye as a float. A step is a sixteenth of the smallest cell's size; more bits take longer to sort.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "render/project/screen_view.h"
#include "stream/model/brick.h"
#include "stream/model/octree.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// Both inclusive, in drawing order.
struct KeyRange {
  uint32_t first = 0, last = 0;
};

/// Keys that increase in drawing order: front to back they increase with the depth, back to front they are
/// those keys' complements. Pure.
class DepthKeys {
 public:
  DepthKeys(const ScreenView& view, const RootCube& root, DrawingOrder order);

  DrawingOrder order() const { return order_; }
  KeyRange rangeOf(const Brick& brick) const;
  /// The keys of what a BrickProjector has made of a brick.
  ///   depths  [n]  BrickProjector::depths(), from the brick's cell with the minimum corner `cell_min`
  ///   range        of the brick
  ///   keys    [n]  overwritten
  void keysOf(std::span<const float> depths, const glm::dvec3& cell_min, const KeyRange& range,
              std::span<uint32_t> keys) const;

 private:
  double depthOf(const glm::dvec3& data) const;

  const ScreenView view_;
  const DrawingOrder order_;
  double nearest_ = 0;  // orthographic: of the root
  double steps_ = 1;    // orthographic: keys to a stretched unit
};

}  // namespace curvisplat
