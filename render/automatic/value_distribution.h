// How a scalar's values are spread over the data's volume: percentiles, and a histogram over an axis that
// suits them.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "render/automatic/coarse_samples.h"
#include "render/colour/function_parts.h"

namespace curvisplat {

/// Sorts the samples once: 30 ms for 300,000.
class ValueDistribution {
 public:
  /// Requires at least one sample.
  explicit ValueDistribution(const CoarseSamples& samples);

  /// The value below which the share `part` (0..1) of the volume lies.
  double percentile(double part) const;
  /// The value below which the share `part` of the samples lies, however small their volume.
  double percentileOfSamples(double part) const;

 private:
  std::vector<float> values_;       // sorted
  std::vector<double> cumulative_;  // [sample]: volume up to and including it
};

/// The volume's shares in bins of equal width, of the scalar or of its asinh.
struct VolumeHistogram {
  static constexpr size_t kBins = 128;

  std::optional<AsinhScale> asinh;       // nullopt: a linear axis
  double low = 0, high = 1;              // ends of the axis, as coordinates
  std::array<double, kBins> shares{};    // sums to 1
  std::array<double, kBins> smoothed{};  // by a Gaussian of 2 bins; sums to 1

  double coordinate(double scalar) const { return asinh ? asinh->coordinate(scalar) : scalar; }
  double scalar(double coordinate) const { return asinh ? asinh->scalar(coordinate) : coordinate; }
  /// Coordinate of the middle of a bin.
  double middle(size_t bin) const { return low + (static_cast<double>(bin) + 0.5) / kBins * (high - low); }
  /// The bin of a scalar; values beyond the ends are in the outermost bins.
  size_t binOf(double scalar) const;
};

/// The axis is asinh where the values reach 8 times as far as their central 98 % (by volume), and ends
/// where 0.01 % of the samples lie beyond. Nothing if all samples have one value.
std::optional<VolumeHistogram> volumeHistogram(const CoarseSamples& samples,
                                               const ValueDistribution& distribution);

}  // namespace curvisplat
