// The values of the samples around a splat, which its scalar stays among: the one place where means and slopes are
// bounded that come from a division, of differences by the steps between samples. Where samples nearly coincide, at poles
// and on singular lines, or where cells are slivers, such a gradient has nothing but rounding in it. Slopes of nodes' splats
// are differences of samples, half of one along each axis, and stay within the bound by themselves. Pure: any thread.
#pragma once

#include <algorithm>
#include <glm/geometric.hpp>

#include "stream/model/splats.h"

namespace curvisplat {

class SampleRange {
 public:
  /// `own`: the value of the splat's own sample.
  explicit SampleRange(double own) : least_(own), most_(own) {}

  void add(double value) {
    least_ = std::min(least_, value);
    most_ = std::max(most_, value);
  }

  /// Returns the scalar with its mean among the samples, and with a slope that changes it across the splat by no more than four
  /// times what they differ by.
  SplatScalar bounded(SplatScalar scalar) const {
    scalar.mean = std::clamp(scalar.mean, least_, most_);
    const double length = glm::length(scalar.slope), most = kSteepest * (most_ - least_);
    if (length > most) scalar.slope *= most / length;
    return scalar;
  }

 private:
  // A linear field in the corner cell of a block changes by 1.7 times the range, and by twice that where the cell is longer than
  // those beside it.
  static constexpr double kSteepest = 4;

  double least_, most_;
};

}  // namespace curvisplat
