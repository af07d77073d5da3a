#include "render/automatic/value_distribution.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "render/automatic/rounded.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr double kSkewedReach = 8;  // of all values, in widths of the central 98 %
constexpr double kClippedSamples = 1e-4;
constexpr double kMinAsinhWidth = 0.003;  // of the values' reach
constexpr int kSmoothedBins = 8;          // on either side: four standard deviations
constexpr double kSmoothing = 2;          // bins

std::array<double, VolumeHistogram::kBins> smooth(const std::array<double, VolumeHistogram::kBins>& shares) {
  constexpr int kLast = static_cast<int>(VolumeHistogram::kBins) - 1;
  std::array<double, VolumeHistogram::kBins> result{};
  double sum = 0;
  for (int bin = 0; bin <= kLast; ++bin) {
    for (int away = -kSmoothedBins; away <= kSmoothedBins; ++away)
      result[static_cast<size_t>(bin)] += std::exp(-0.5 * away * away / (kSmoothing * kSmoothing)) *
                                          shares[static_cast<size_t>(std::clamp(bin + away, 0, kLast))];
    sum += result[static_cast<size_t>(bin)];
  }
  for (double& share : result) share /= sum;
  return result;
}

/// A number that is larger for a larger value.
uint32_t sortable(float value) {
  const auto bits = std::bit_cast<uint32_t>(value + 0.0f);  // -0 is 0
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}

}  // namespace

ValueDistribution::ValueDistribution(const CoarseSamples& samples) {
  CURVISPLAT_CHECK(samples.size() > 0);
  std::vector<uint64_t> order(samples.size());
  for (size_t n = 0; n < order.size(); ++n) order[n] = uint64_t{sortable(samples.values[n])} << 32 | n;
  std::sort(order.begin(), order.end());
  values_.reserve(order.size());
  cumulative_.reserve(order.size());
  double sum = 0;
  for (const uint64_t key : order) {
    const auto n = static_cast<uint32_t>(key);
    values_.push_back(samples.values[n]);
    cumulative_.push_back(sum += samples.volumes[n]);
  }
}

double ValueDistribution::percentile(double part) const {
  const auto found = std::lower_bound(cumulative_.begin(), cumulative_.end(), part * cumulative_.back());
  return values_[std::min(static_cast<size_t>(found - cumulative_.begin()), values_.size() - 1)];
}

double ValueDistribution::percentileOfSamples(double part) const {
  const auto last = static_cast<double>(values_.size() - 1);
  return values_[static_cast<size_t>(std::lround(std::clamp(part, 0.0, 1.0) * last))];
}

size_t VolumeHistogram::binOf(double scalar) const {
  const double part = (coordinate(scalar) - low) / (high - low) * kBins;
  return static_cast<size_t>(std::clamp(part, 0.0, static_cast<double>(kBins - 1)));
}

std::optional<VolumeHistogram> volumeHistogram(const CoarseSamples& samples,
                                               const ValueDistribution& distribution) {
  const double low = distribution.percentileOfSamples(kClippedSamples);
  const double high = distribution.percentileOfSamples(1 - kClippedSamples);
  if (!(low < high) || !(samples.volume > 0)) return std::nullopt;
  VolumeHistogram histogram;
  const double central = distribution.percentile(0.99) - distribution.percentile(0.01);
  if (!(high - low <= kSkewedReach * central)) {
    const double quartiles = distribution.percentile(0.75) - distribution.percentile(0.25);
    const double width = std::max(0.5 * quartiles, kMinAsinhWidth * (high - low));
    // Few digits, so that the axis can be printed and typed.
    histogram.asinh =
        AsinhScale{roundedTo(distribution.percentile(0.5), width, 2), roundedTo(width, width, 2)};
  }
  histogram.low = histogram.coordinate(low);
  histogram.high = histogram.coordinate(high);
  for (size_t n = 0; n < samples.size(); ++n)
    histogram.shares[histogram.binOf(samples.values[n])] += samples.volumes[n] / samples.volume;
  histogram.smoothed = smooth(histogram.shares);
  return histogram;
}

}  // namespace curvisplat
