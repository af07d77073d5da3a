// Depths as integers, the keys by which a frame's splats are sorted.
//
// A key depends only on the splat, its brick and the view, and never lies outside of the range that the
// brick's box gives. If bricks are taken in the order of those ranges, the index alone says which keys
// can still come. A splat's key is the depth of its centre. If a piece of a splat (at a border, or cut in
// perspective) has its centre outside of the box of its brick's centres, it gets the box's nearest or
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

/// The first and the last key in drawing order, both inclusive.
struct KeyRange {
  uint32_t first = 0, last = 0;
};

/// Keys that increase in drawing order: front to back they increase with the depth; back to front they are
/// the complements of those keys. Pure.
class DepthKeys {
 public:
  DepthKeys(const ScreenView& view, const RootCube& root, DrawingOrder order);

  DrawingOrder order() const { return order_; }
  KeyRange rangeOf(const Brick& brick) const;
  /// Computes the keys of a brick's projected splats.
  ///   depths  [n]  BrickProjector::depths(), from the brick's cell with the minimum corner `cell_min`
  ///   range        of the brick
  ///   keys    [n]  overwritten
  void keysOf(std::span<const float> depths, const glm::dvec3& cell_min, const KeyRange& range,
              std::span<uint32_t> keys) const;

 private:
  double depthOf(const glm::dvec3& data) const;

  const ScreenView view_;
  const DrawingOrder order_;
  double nearest_ = 0;  // orthographic: the depth of the root cube's nearest point
  double steps_ = 1;    // orthographic: keys per stretched unit
};

}  // namespace curvisplat
