#include "render/colour/opacity_curve.h"

#include <algorithm>
#include <cmath>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

// The curve from the lower opacity (0) to the upper one (1), at the fraction `part` of the way in x.
double progress(double part, double midpoint, double sharpness) {
  midpoint = std::clamp(midpoint, 1e-5, 1 - 1e-5);
  double s = part < midpoint ? 0.5 * part / midpoint : 0.5 + 0.5 * (part - midpoint) / (1 - midpoint);
  // VTK's thresholds, beyond which the curve is a step or straight.
  if (sharpness > 0.99) return s < 0.5 ? 0 : 1;
  if (sharpness < 0.01) return s;
  const double power = 1 + 10 * sharpness;
  s = s < 0.5 ? 0.5 * std::pow(2 * s, power) : 1 - 0.5 * std::pow(2 * (1 - s), power);
  // A Hermite curve from 0 to 1 with the slope 1 - sharpness at both ends.
  const double rise = s * s * (3 - 2 * s);
  const double slopes = s * (1 - s) * (1 - 2 * s);
  return std::clamp(rise + slopes * (1 - sharpness), 0.0, 1.0);
}

}  // namespace

OpacityCurve::OpacityCurve(std::span<const OpacityPoint> points) : points_(points.begin(), points.end()) {
  CURVISPLAT_CHECK(!points_.empty());
}

double OpacityCurve::at(double x) const {
  const auto upper = std::lower_bound(points_.begin(), points_.end(), x,
                                      [](const OpacityPoint& p, double value) { return p.x < value; });
  if (upper == points_.begin()) return points_.front().opacity;
  if (upper == points_.end()) return points_.back().opacity;
  const OpacityPoint& lower = *(upper - 1);
  const double part = (x - lower.x) / (upper->x - lower.x);
  return std::lerp(lower.opacity, upper->opacity, progress(part, lower.midpoint, lower.sharpness));
}

}  // namespace curvisplat
