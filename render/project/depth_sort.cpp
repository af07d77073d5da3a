#include "render/project/depth_sort.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "render/project/tile_key.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// The largest keys, out of 2^32: steps are below a micron of a metre, and parts of bricks have no more than a
// few million.
constexpr double kMaxKey = (1 << 28) - 1, kMaxPerspectiveKey = (1 << 30) - 1;
// The reach of pieces, in a brick's largest radius. Cutting a splat moves the centres of its pieces by less
// than half the sum of A's columns, 1.5 of its singular values, and a border by less than 0.6; a radius has
// 1.55 of them.
constexpr double kPieceReach = 1.35;
// Pixels from a splat's own support to the middle of a tile that it touches: half the tile's diagonal, and
// what the low-pass adds.
const double kBeyond = std::numbers::sqrt2 * 0.5 * kOrderSide + kKernelSupport * std::sqrt(kLowPass);

}  // namespace

DepthKeys::DepthKeys(const ScreenView& view, const RootCube& root) : view_(view) {
  const glm::dvec3 along = view.forward * view.scale;
  const double middle = depthOf(root.min + 0.5 * glm::dvec3(root.size));
  const double half = 0.5 * root.size * (std::abs(along.x) + std::abs(along.y) + std::abs(along.z));
  if (!perspective()) {
    nearest_ = middle - half;
    if (half > 0) steps_ = kMaxKey / (2 * half);
    return;
  }
  const double from_eye = middle - glm::dot(view.forward, view.eye);
  const double near = std::max(from_eye - half, view.near), far = std::max(from_eye + half, near);
  nearest_ = -1 / near;
  if (far > near) steps_ = kMaxPerspectiveKey / (1 / near - 1 / far);
}

double DepthKeys::depthOf(const glm::dvec3& data) const {
  return glm::dot(view_.forward, view_.scale * data);
}

/// Defined for NaN as well.
uint32_t DepthKeys::keyOf(double depth) const {
  const double most = perspective() ? kMaxPerspectiveKey : kMaxKey;
  return static_cast<uint32_t>(std::min(std::max(0.0, (depth - nearest_) * steps_), most));
}

KeyRange DepthKeys::rangeOf(const Brick& brick) const {
  const double pixel = 1 / view_.focal_px;  // in perspective at a distance of 1
  const double radius = brick.largest_radius * std::max({view_.scale.x, view_.scale.y, view_.scale.z});
  const double middle = depthOf(0.5 * (brick.lower + brick.upper));
  const double half = 0.5 * glm::dot(glm::abs(view_.forward * view_.scale), brick.upper - brick.lower);
  const double leaning = kSteepest * kBeyond * pixel;
  uint32_t nearest, farthest;
  if (perspective()) {
    const double from_eye = middle - glm::dot(view_.forward, view_.eye);
    double near = from_eye - half, far = from_eye + half;
    // Splats that are wide for their distance are cut into pieces, each of which has its own depth.
    if (near < view_.near || radius > view_.widest * near) {
      near -= kPieceReach * radius;
      far += kPieceReach * radius;
    }
    near = std::max(near, view_.near);
    far = std::max(far, near);
    nearest = keyOf(-1 / near * (1 + radius / near + leaning));
    farthest = keyOf(-1 / far * (1 - radius / far - leaning));
  } else {
    nearest = keyOf(middle - half - radius - leaning);
    farthest = keyOf(middle + half + radius + leaning);
  }
  return {nearest, farthest};
}

DepthKeys::Linear DepthKeys::linear(const glm::dvec3& cell_min) const {
  const double inverse_base = perspective() ? 1 / view_.orderBase(cell_min) : 0;
  const double origin = perspective() ? -inverse_base : depthOf(cell_min);
  const double base = std::clamp((origin - nearest_) * steps_, -0x1p30, 0x1p30);
  return {static_cast<int32_t>(base), static_cast<float>(steps_), static_cast<float>(steps_ / view_.focal_px),
          static_cast<float>(inverse_base)};
}

void DepthKeys::setKeys(std::span<ScreenSplat> splats, std::span<const float> depths,
                        const glm::dvec3& cell_min, const KeyRange& range, std::span<uint32_t> keys) const {
  CURVISPLAT_CHECK_OP(depths.size(), ==, keys.size());
  CURVISPLAT_CHECK_OP(depths.size(), ==, splats.size());
  const double inverse_base = perspective() ? 1 / view_.orderBase(cell_min) : 0;
  const double origin = perspective() ? -inverse_base : depthOf(cell_min);
  const auto steps_a_pixel =
      static_cast<float>(steps_ / view_.focal_px);  // at a distance of 1, in perspective
  size_t first_record = 0;                          // the records of a splat come before it
  for (size_t n = 0; n < splats.size(); ++n) {
    ScreenSplat& splat = splats[n];
    if (isRecord(splat)) continue;
    const auto depth = static_cast<double>(depths[n]);
    splat.key = keyOf(origin + depth);
    if (leans(splat)) {
      const float steps =
          perspective() ? steps_a_pixel * static_cast<float>(inverse_base - depth) : steps_a_pixel;
      splat.key_slope0 *= steps;
      splat.key_slope1 *= steps;
    }
    setFirst(splat);
    splat.first = std::clamp(splat.first, range.first, range.last);
    splat.key = std::clamp(splat.key, range.first, range.last);
    for (; first_record <= n; ++first_record) keys[first_record] = splat.first;
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

std::span<const DepthItem> DepthSorter::sort(std::span<const uint32_t> keys) {
  items_.resize(keys.size());
  for (uint32_t n = 0; n < keys.size(); ++n) items_[n] = {keys[n], n};
  return sort();
}

std::span<DepthItem> DepthSorter::items(size_t count) {
  items_.resize(count);
  return items_;
}

}  // namespace curvisplat
