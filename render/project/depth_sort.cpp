#include "render/project/depth_sort.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kMaxKey = (1 << 28) - 1;
// Of a brick's largest radius. Cutting a splat moves the centres of its pieces by less than half the sum of
// A's columns, 1.5 of its singular values, and a border by less than 0.6; a radius has 1.55 of them.
constexpr double kPieceReach = 1.35;

/// Defined for NaN as well.
uint32_t keyOf(double steps) {
  return static_cast<uint32_t>(std::min(std::max(0.0, steps), kMaxKey));
}

/// The bits of a distance, which must not be negative: they increase with the distance.
uint32_t bitsOf(float distance) {
  return std::bit_cast<uint32_t>(distance);
}

}  // namespace

DepthKeys::DepthKeys(const ScreenView& view, const RootCube& root, DrawingOrder order)
    : view_(view), order_(order) {
  if (view.projection == Projection::kPerspective) return;
  const glm::dvec3 along = view.forward * view.scale;
  nearest_ = depthOf(root.min + glm::dvec3(along.x < 0, along.y < 0, along.z < 0) * root.size);
  const double extent = root.size * (std::abs(along.x) + std::abs(along.y) + std::abs(along.z));
  if (extent > 0) steps_ = kMaxKey / extent;
}

double DepthKeys::depthOf(const glm::dvec3& data) const {
  return glm::dot(view_.forward, view_.scale * data);
}

KeyRange DepthKeys::rangeOf(const Brick& brick) const {
  const glm::dvec3 lower = view_.scale * brick.lower, upper = view_.scale * brick.upper;
  uint32_t nearest, farthest;
  if (view_.projection == Projection::kPerspective) {
    double near = glm::length(glm::clamp(view_.eye, lower, upper) - view_.eye);
    double far = glm::length(glm::max(glm::abs(lower - view_.eye), glm::abs(upper - view_.eye)));
    // Splats that are wide for their distance are cut into pieces, each of which has its own depth.
    const double radius = brick.largest_radius * std::max({view_.scale.x, view_.scale.y, view_.scale.z});
    const glm::dvec3 half = 0.5 * (upper - lower);
    const double nearest_plane =
        glm::dot(view_.forward, 0.5 * (lower + upper) - view_.eye) - glm::dot(glm::abs(view_.forward), half);
    if (nearest_plane < view_.near || radius > view_.widest * nearest_plane) {
      near -= kPieceReach * radius;
      far += kPieceReach * radius;
    }
    nearest = bitsOf(static_cast<float>(std::max(near, 0.0)));
    farthest = bitsOf(static_cast<float>(far));
  } else {
    const glm::dvec3 along = view_.forward * view_.scale;
    const double middle = depthOf(0.5 * (brick.lower + brick.upper)) - nearest_;
    const double half = 0.5 * glm::dot(glm::abs(along), brick.upper - brick.lower);
    nearest = keyOf((middle - half) * steps_);
    farthest = keyOf((middle + half) * steps_);
  }
  return order_ == DrawingOrder::kFrontToBack ? KeyRange{nearest, farthest} : KeyRange{~farthest, ~nearest};
}

void DepthKeys::keysOf(std::span<const float> depths, const glm::dvec3& cell_min, const KeyRange& range,
                       std::span<uint32_t> keys) const {
  CURVISPLAT_CHECK_OP(depths.size(), ==, keys.size());
  const uint32_t flip = order_ == DrawingOrder::kFrontToBack ? 0 : ~uint32_t{0};
  if (view_.projection == Projection::kPerspective) {
    for (size_t n = 0; n < depths.size(); ++n)
      keys[n] = std::clamp(bitsOf(depths[n]) ^ flip, range.first, range.last);
  } else {
    const double origin = depthOf(cell_min) - nearest_;
    for (size_t n = 0; n < depths.size(); ++n)
      keys[n] = std::clamp(keyOf((origin + static_cast<double>(depths[n])) * steps_) ^ flip, range.first,
                           range.last);
  }
}

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
