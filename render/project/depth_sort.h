// Orders the splats of a brick by depth: a radix sort, two passes of 16 bits for large bricks, four of 8 for
// small ones.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stream/paging/cut.h"

namespace curvisplat {

/// Keeps its memory between calls. One thread each.
class DepthSorter {
 public:
  /// The indices of `depths` (finite, at most 2^32 - 1), farthest (largest) first; equal depths in index
  /// order. Valid until the next call.
  std::span<const uint32_t> farthestFirst(std::span<const float> depths) {
    return sort(depths, DrawingOrder::kBackToFront);
  }
  /// Back to front as farthestFirst(); front to back the same from end to beginning.
  std::span<const uint32_t> sort(std::span<const float> depths, DrawingOrder order);

 private:
  struct Item {
    uint32_t key, index;
  };
  template <int digit_bits>
  void sortItems();

  std::vector<Item> items_, other_;
  std::vector<uint32_t> starts_;
  std::vector<uint32_t> order_;
};

}  // namespace curvisplat
