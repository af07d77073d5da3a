// How a scalar's values are spread over the data's volume, and the opacities that follow from it: values
// that fill much of the volume are nearly clear, rare ones show. DESIGN.md, "The first picture".
//
//   CoarseSamples -> ValueDistribution -> VolumeHistogram -> BinExtinctions -> seenInterval, opacityPoints
//
// Sorting 300,000 samples takes some milliseconds, the rest a few passes over 128 bins. The same samples
// give the same opacities. All is pure or immutable; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "render/automatic/coarse_samples.h"
#include "render/colour/control_points.h"
#include "render/colour/function_parts.h"

namespace curvisplat {

/// Percentiles, by volume and by number of samples. Sorts the samples once.
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
/// where 0.01 % of the samples lie beyond. nullopt if all samples have one value.
std::optional<VolumeHistogram> volumeHistogram(const CoarseSamples& samples,
                                               const ValueDistribution& distribution);

/// How many values fill most of the volume, as numbers of materials do: 0 if they do not, or are spread.
size_t fillingValues(const VolumeHistogram& histogram);

using BinExtinctions = std::array<double, VolumeHistogram::kBins>;

/// Relative extinctions of the histogram's bins; the largest is 1.
BinExtinctions extinctionsOf(const VolumeHistogram& histogram);

/// The coordinates between which the middle 99 % of the volume lie, weighted by extinction.
std::pair<double, double> seenInterval(const VolumeHistogram& histogram, const BinExtinctions& extinctions);

using BinWeights = std::array<double, VolumeHistogram::kBins>;

/// The part of the interval [begin, end] in which the middle 98 % of what is seen lie, if that is under 55 % of it: rare values behind
/// others, which take their light, would leave the picture few of the colours. `seen` [bin]. `middle`: of a diverging map, whose
/// interval stays symmetric.
std::optional<std::pair<double, double>> narrowedInterval(const VolumeHistogram& histogram,
                                                          const BinWeights& seen, double begin, double end,
                                                          std::optional<double> middle);

/// The opacities over [begin, end] (coordinates of the histogram), for an opacity unit at which the largest
/// extinction has an optical depth of 2.3, by at most 24 points. Positions are 0..1 from begin to end.
std::vector<OpacityPoint> opacityPoints(const VolumeHistogram& histogram, const BinExtinctions& extinctions,
                                        double begin, double end);

/// The points, each with an opacity of `least` or more.
std::vector<OpacityPoint> raisedTo(double least, std::vector<OpacityPoint> points);

}  // namespace curvisplat
