// The order in which splats are drawn: depths as integers, the keys of splats (DepthKeys), and the sort by
// them (DepthSorter).
//
// A key depends only on the splat, its brick and the view, and never lies outside of the range that the
// brick's box gives. If bricks are taken in the order of those ranges, the index alone says which keys
// can still come. Splats with equal keys are ordered by their numbers, so that the order is the same for any
// threads.
//
// The sort is a stable radix sort, with as few passes as the range of the keys needs: one to three.
// DepthKeys are immutable; each sorter belongs to one thread.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/project/screen_splat.h"
#include "render/project/screen_view.h"
#include "stream/model/octree.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// The first and the last key in drawing order, both inclusive.
struct KeyRange {
  uint32_t first = 0, last = 0;
};

/// Keys that increase with the depth.
///
/// A splat has a key at its centre, and how that changes over the screen (tile_key.h). The sweep takes it by
/// the first key that it has in any tile; if that lies before the keys of its brick, by the first of those.
/// Keys are even steps of the depth along the view in the root's cube, in perspective of one over it: then
/// they are linear over a plane as it is seen. More bits take longer to sort.
class DepthKeys {
 public:
  DepthKeys(const ScreenView& view, const RootCube& root);

  KeyRange rangeOf(const Brick& brick) const;
  /// Computes the keys of a brick's projected splats.
  ///   splats  [n]  BrickProjector::splats(): their keys are set, and their slopes become keys a pixel
  ///   depths  [n]  BrickProjector::depths(), from the brick's cell with the minimum corner `cell_min`
  ///   range        of the brick
  ///   keys    [n]  overwritten: the first key of each splat, and of the records before it
  void setKeys(std::span<ScreenSplat> splats, std::span<const float> depths, const glm::dvec3& cell_min,
               const KeyRange& range, std::span<uint32_t> keys) const;

  /// The key at the depth d (BrickProjector::depths()) is base + steps d. A slope of one pixel of depth a pixel is
  /// steps_a_pixel (inverse_base - d) keys, in orthographic views steps_a_pixel.
  struct Linear {
    int32_t base;
    float steps, steps_a_pixel, inverse_base;
  };
  /// Returns what setKeys() computes of a brick in double precision.
  Linear linear(const glm::dvec3& cell_min) const;

 private:
  bool perspective() const { return view_.projection == Projection::kPerspective; }
  double depthOf(const glm::dvec3& data) const;
  uint32_t keyOf(double depth) const;

  const ScreenView view_;
  // Depths are stretched units along the view; in perspective, minus one over those from the eye.
  double nearest_ = 0;  // of the root's cube
  double steps_ = 1;    // keys a unit of depth
};

struct DepthItem {
  uint32_t key, splat;
};

/// Sorts splats by their depth keys. Keeps its memory between calls: 16 bytes per item.
class DepthSorter {
 public:
  /// Sorts splats 0 .. keys.size() - 1 by their keys, those with equal keys by their numbers. Valid until the
  /// next call.
  std::span<const DepthItem> sort(std::span<const uint32_t> keys);

  /// Space for `count` items, which the caller fills before sort().
  std::span<DepthItem> items(size_t count);
  /// Sorts the items by ascending key. Items with equal keys keep their order. Valid until the next call.
  std::span<const DepthItem> sort();

 private:
  template <int passes>
  void sortBits(uint32_t least, int bits);

  std::vector<DepthItem> items_, other_;
  std::vector<uint32_t> starts_;
};

}  // namespace curvisplat
