#include "render/project/depth_sort.h"

#include <algorithm>
#include <bit>

namespace curvisplat {
namespace {

// Below this, clearing the counters of 16-bit digits costs more than two further passes. Measured.
constexpr size_t kFewItems = 12000;

/// Unsigned order of the keys is descending order of the depths.
uint32_t farthestFirstKey(float depth) {
  const auto bits = std::bit_cast<uint32_t>(depth + 0.0f);  // -0 becomes 0: they are equal depths
  const uint32_t ascending = bits & 0x80000000u ? ~bits : bits | 0x80000000u;
  return ~ascending;
}

}  // namespace

template <int digit_bits>
void DepthSorter::sortItems() {
  constexpr int kPasses = 32 / digit_bits;
  constexpr uint32_t kDigits = 1u << digit_bits;
  starts_.assign(kPasses * kDigits, 0);
  for (const Item& item : items_)
    for (int pass = 0; pass < kPasses; ++pass)
      ++starts_[pass * kDigits + (item.key >> (pass * digit_bits) & (kDigits - 1))];

  for (int pass = 0; pass < kPasses; ++pass) {
    uint32_t* starts = &starts_[pass * kDigits];
    uint32_t start = 0;
    for (uint32_t digit = 0; digit < kDigits; ++digit) {
      const uint32_t count = starts[digit];
      starts[digit] = start;
      start += count;
    }
    for (const Item& item : items_) other_[starts[item.key >> (pass * digit_bits) & (kDigits - 1)]++] = item;
    items_.swap(other_);
  }
}

std::span<const uint32_t> DepthSorter::sort(std::span<const float> depths, DrawingOrder order) {
  items_.resize(depths.size());
  other_.resize(depths.size());
  for (uint32_t i = 0; i < depths.size(); ++i) items_[i] = {farthestFirstKey(depths[i]), i};
  if (depths.size() < kFewItems) {
    sortItems<8>();
  } else {
    sortItems<16>();
  }
  order_.resize(depths.size());
  for (size_t i = 0; i < items_.size(); ++i) order_[i] = items_[i].index;
  if (order == DrawingOrder::kFrontToBack) std::reverse(order_.begin(), order_.end());
  return order_;
}

}  // namespace curvisplat
