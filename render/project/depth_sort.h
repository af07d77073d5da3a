// Sorts splats by their depth keys: a stable radix sort with as few passes as the range of the keys needs.
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

/// Keeps its memory between calls: 16 bytes per item. Each sorter belongs to one thread.
class DepthSorter {
 public:
  /// Sorts splats 0 .. keys.size() - 1 by their keys. Splats with equal keys are sorted by their numbers,
  /// ascending if `order` is front to back and descending if it is back to front. Valid until the next call.
  std::span<const DepthItem> sort(std::span<const uint32_t> keys, DrawingOrder order);

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
