// How the magnitude of a scalar's gradient is spread over the volume, for the editor of the opacity by gradient: a
// histogram on a logarithmic axis. Immutable; any thread.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "render/project/gradient_opacity.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

class GradientHistogram {
 public:
  /// The axis ends at the largest magnitude and covers four decades at most; what is less steep counts in the first bin.
  GradientHistogram(const GradientPercentiles& percentiles, size_t bins);

  /// [bins]: shares of the volume; their sum is 1. Empty if the scalar is the same everywhere.
  const std::vector<double>& shares() const { return shares_; }
  /// The magnitude at `x` from 0 to 1, and where a magnitude stands.
  double magnitudeAt(double x) const;
  double coordinateOf(double magnitude) const;

 private:
  double lowest_ = 0, largest_ = 0;
  std::vector<double> shares_;
};

/// "0.25 K per km": a magnitude with the scalar's unit per length.
std::string gradientText(double magnitude, const VariableInfo& scalar, bool on_globe);

}  // namespace curvisplat
