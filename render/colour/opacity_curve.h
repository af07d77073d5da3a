// Opacity between control points, as VTK's vtkPiecewiseFunction has it.
//
// Between two points the curve follows the lower one's midpoint and sharpness: it passes through the mean of
// the two opacities at the midpoint (a fraction of the way); sharpness 0 is two straight lines, 1 a step at
// the midpoint, and what lies between is a Hermite curve over a compressed parameter.
#pragma once

#include <span>
#include <vector>

namespace curvisplat {

struct OpacityPoint {
  double x;
  double opacity;          // 0..1
  double midpoint = 0.5;   // 0..1, between this point and the next
  double sharpness = 0.0;  // 0..1
};

/// Immutable; any thread may ask.
class OpacityCurve {
 public:
  OpacityCurve() = default;
  /// `points`: at least one, in the order of x. Points of equal x are a jump; the first holds at x itself.
  explicit OpacityCurve(std::span<const OpacityPoint> points);

  /// Below and above the points their ends' opacities.
  double at(double x) const;

 private:
  std::vector<OpacityPoint> points_;
};

}  // namespace curvisplat
