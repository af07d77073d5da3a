#include "stream/cache/series_values.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace curvisplat {
namespace {

constexpr uint64_t kArrays = 5;           // of a SplatVariable
constexpr uint64_t kOverheadBytes = 512;  // of an entry: its nodes, and the allocator's of six blocks

/// Grows with both numbers, so that blended bounds are bounds of blended values.
float blended(float earlier, float later, double part) {
  return static_cast<float>((1 - part) * double{earlier} + part * double{later});
}

/// Makes up for rounding, in the length of a vector whose components have been rounded each.
float roundedUp(float value) {
  constexpr float kMax = std::numeric_limits<float>::infinity();
  return value > 0 ? std::nextafter(std::nextafter(value, kMax), kMax) : value;
}

}  // namespace

uint64_t KeptValues::charge(uint64_t splats) {
  return kArrays * sizeof(float) * splats + kOverheadBytes;
}

KeptValues::Values KeptValues::find(const Key& key) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(key);
  if (found == entries_.end()) {
    ++statistics_.misses;
    return nullptr;
  }
  ++statistics_.hits;
  used_.splice(used_.end(), used_, found->second.used);
  return found->second.values;
}

void KeptValues::keep(const Key& key, Values values) {
  const uint64_t bytes = charge(values->size());
  if (bytes > capacity_) return;
  const MutexLock lock(mutex_);
  if (entries_.contains(key)) return;
  while (statistics_.bytes + bytes > capacity_) {
    const auto oldest = entries_.find(used_.front());
    statistics_.bytes -= charge(oldest->second.values->size());
    entries_.erase(oldest);
    used_.pop_front();
  }
  entries_[key] = {std::move(values), used_.insert(used_.end(), key)};
  statistics_.bytes += bytes;
  statistics_.peak_bytes = std::max(statistics_.peak_bytes, statistics_.bytes);
}

KeptValues::Statistics KeptValues::statistics() const {
  const MutexLock lock(mutex_);
  return statistics_;
}

void blendValues(const VariableArrays<float>& values, const VariableArrays<const float>& later, double part) {
  const auto blend = [&](float* into, const float* from) {
    for (size_t n = 0; n < values.count; ++n) into[n] = blended(into[n], from[n], part);
  };
  blend(values.mean, later.mean);
  blend(values.slope0, later.slope0);
  blend(values.slope1, later.slope1);
  blend(values.slope2, later.slope2);
  for (size_t n = 0; n < values.count; ++n) {
    const double deviation =
        (1 - part) * std::sqrt(double{values.variance[n]}) + part * std::sqrt(double{later.variance[n]});
    values.variance[n] = static_cast<float>(deviation * deviation);
  }
}

BrickVariable blendedRecord(const BrickVariable& earlier, const BrickVariable& later, double part) {
  BrickVariable record = earlier;
  record.min = blended(earlier.min, later.min, part);
  record.max = blended(earlier.max, later.max, part);
  record.largest_slope = roundedUp(blended(earlier.largest_slope, later.largest_slope, part));
  record.largest_deviation = roundedUp(blended(earlier.largest_deviation, later.largest_deviation, part));
  return record;
}

}  // namespace curvisplat
