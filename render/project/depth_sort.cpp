#include "render/project/depth_sort.h"

#include <algorithm>
#include <bit>

namespace curvisplat {
namespace {

// The counters of two or three digits fit in the processor's caches. For few items, clearing more counters
// takes longer than another pass (measured).
constexpr size_t kFewItems = 12000;
constexpr int kMaxDigitBits = 13, kMaxDigitBitsOfFew = 11;

}  // namespace

template <int passes>
void DepthSorter::sortBits(uint32_t least, int bits) {
  const int digit_bits = (bits + passes - 1) / passes;
  const uint32_t digits = 1u << digit_bits, mask = digits - 1;
  starts_.assign(size_t{passes} * digits, 0);
  for (const DepthItem& item : items_)
    for (int pass = 0; pass < passes; ++pass)
      ++starts_[static_cast<size_t>(pass) * digits + ((item.key - least) >> (pass * digit_bits) & mask)];
  other_.resize(items_.size());
  for (int pass = 0; pass < passes; ++pass) {
    uint32_t* const starts = &starts_[static_cast<size_t>(pass) * digits];
    uint32_t start = 0;
    for (uint32_t digit = 0; digit < digits; ++digit) {
      const uint32_t count = starts[digit];
      starts[digit] = start;
      start += count;
    }
    DepthItem* const sorted = other_.data();
    for (const DepthItem& item : items_)
      sorted[starts[(item.key - least) >> (pass * digit_bits) & mask]++] = item;
    items_.swap(other_);
  }
}

std::span<const DepthItem> DepthSorter::sort() {
  uint32_t least = ~uint32_t{0}, most = 0;
  for (const DepthItem& item : items_) {
    least = std::min(least, item.key);
    most = std::max(most, item.key);
  }
  if (least >= most) return items_;
  const int bits = std::bit_width(most - least);
  const int max_digit_bits = items_.size() < kFewItems ? kMaxDigitBitsOfFew : kMaxDigitBits;
  if (bits <= max_digit_bits)
    sortBits<1>(least, bits);
  else if (bits <= 2 * max_digit_bits)
    sortBits<2>(least, bits);
  else
    sortBits<3>(least, bits);
  return items_;
}

std::span<const DepthItem> DepthSorter::sort(std::span<const uint32_t> keys, DrawingOrder order) {
  items_.resize(keys.size());
  const auto count = static_cast<uint32_t>(keys.size());
  if (order == DrawingOrder::kFrontToBack) {
    for (uint32_t n = 0; n < count; ++n) items_[n] = {keys[n], n};
  } else {
    for (uint32_t n = 0; n < count; ++n) items_[n] = {keys[count - 1 - n], count - 1 - n};
  }
  return sort();
}

std::span<DepthItem> DepthSorter::items(size_t count) {
  items_.resize(count);
  return items_;
}

}  // namespace curvisplat
