#include "stream/cache/between_steps.h"

#include <cmath>
#include <limits>

namespace curvisplat {
namespace {

/// Grows with both numbers, so blended bounds are bounds of what is blended.
float blended(float earlier, float later, double part) {
  return static_cast<float>((1 - part) * double{earlier} + part * double{later});
}

/// For lengths of vectors whose components are rounded each.
float roundedUp(float value) {
  constexpr float kMax = std::numeric_limits<float>::infinity();
  return value > 0 ? std::nextafter(std::nextafter(value, kMax), kMax) : value;
}

}  // namespace

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
