// Sorts splats by their depth keys: a radix sort, stable, of as few passes as the keys' range needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/paging/cut.h"

namespace curvisplat {

struct DepthItem {
  uint32_t key, splat;
};

/// Keeps its memory between calls: 16 bytes an item. One thread each.
class DepthSorter {
 public:
  /// Sorts splats by these keys; those of equal keys by their numbers, ascending front to back, descending
  /// back to front.
  std::span<const DepthItem> sort(std::span<const uint32_t> keys, DrawingOrder order);

  /// For the items to sort, to be filled in.
  std::span<DepthItem> items(size_t count);
  /// The items by ascending key; those of equal keys in the order in which they were. Valid until the next
  /// call.
  std::span<const DepthItem> sort();

 private:
  template <int passes>
  void sortBits(uint32_t least, int bits);

  std::vector<DepthItem> items_, other_;
  std::vector<uint32_t> starts_;
};

}  // namespace curvisplat
