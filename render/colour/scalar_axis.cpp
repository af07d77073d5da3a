#include "render/colour/scalar_axis.h"

#include <cmath>

namespace curvisplat {

double AsinhScale::coordinate(double scalar) const {
  return std::asinh((scalar - centre) / width);
}
double AsinhScale::scalar(double coordinate) const {
  return centre + width * std::sinh(coordinate);
}

double ScalarAxis::fractionOf(double scalar) const {
  const auto [low, high] = range;
  if (asinh) {
    const double begin = asinh->coordinate(low);
    return (asinh->coordinate(scalar) - begin) / (asinh->coordinate(high) - begin);
  }
  return log_scale ? std::log(scalar / low) / std::log(high / low) : (scalar - low) / (high - low);
}

double ScalarAxis::scalarAt(double fraction) const {
  const auto [low, high] = range;
  if (fraction == 0) return low;
  if (fraction == 1) return high;
  if (asinh) return asinh->scalar(std::lerp(asinh->coordinate(low), asinh->coordinate(high), fraction));
  return log_scale ? low * std::pow(high / low, fraction) : std::lerp(low, high, fraction);
}

}  // namespace curvisplat
