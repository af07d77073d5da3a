#include "tools/view/gradient_histogram.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace curvisplat {
namespace {

constexpr double kDecades = 4;

}  // namespace

GradientHistogram::GradientHistogram(const GradientPercentiles& percentiles, size_t bins) {
  const auto magnitudes = percentiles.magnitudes();
  largest_ = double{magnitudes.back()};
  if (!(largest_ > 0)) return;
  const auto positive = std::upper_bound(magnitudes.begin(), magnitudes.end(), 0.0f);
  lowest_ = std::clamp(double{*positive}, largest_ * std::pow(10, -kDecades), 0.5 * largest_);
  double below = 0;
  for (size_t n = 1; n <= bins; ++n) {
    const double end = magnitudeAt(static_cast<double>(n) / static_cast<double>(bins));
    const double up_to = n < bins ? percentiles.shareBelow(end) : 1;
    shares_.push_back(up_to - below);
    below = up_to;
  }
}

double GradientHistogram::magnitudeAt(double x) const {
  return lowest_ > 0 ? lowest_ * std::pow(largest_ / lowest_, x) : 0;
}

double GradientHistogram::coordinateOf(double magnitude) const {
  if (!(lowest_ > 0) || !(magnitude > lowest_)) return 0;
  return std::min(std::log(magnitude / lowest_) / std::log(largest_ / lowest_), 1.0);
}

std::string gradientText(double magnitude, const VariableInfo& scalar, bool on_globe) {
  const char* const length = on_globe ? "km" : "length";
  if (scalar.unit.empty()) return fmt::format("{:.4g} per {}", magnitude, length);
  return fmt::format("{:.4g} {} per {}", magnitude, scalar.unit, length);
}

}  // namespace curvisplat
