// Interpolates opacity between control points as VTK's vtkPiecewiseFunction does.
//
// Midpoint and sharpness of a point shape the curve up to the next point. At the midpoint, a fraction of the
// way, the curve has the mean of the two opacities. Sharpness 0 gives two straight lines, 1 a step at the
// midpoint, and values between them a Hermite curve over a compressed parameter.
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
  /// `points`: one or more, sorted by x. Points with equal x are a jump; the first of them holds at x itself.
  explicit OpacityCurve(std::span<const OpacityPoint> points);

  /// The opacity at x. Outside of the points, that of the nearest one.
  double at(double x) const;

 private:
  std::vector<OpacityPoint> points_;
};

}  // namespace curvisplat
