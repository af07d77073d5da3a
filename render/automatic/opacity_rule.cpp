#include "render/automatic/opacity_rule.h"

#include <hwy/contrib/sort/vqsort.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "render/colour/function_parts.h"
#include "stream/base/error.h"

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
  hwy::Sorter()(order.data(), order.size(), hwy::SortAscending());
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

size_t fillingValues(const VolumeHistogram& histogram) {
  constexpr double kMinFilled = 1.0 / VolumeHistogram::kBins, kMostOfVolume = 0.8;
  constexpr size_t kMaxWidth = 2;  // bins: a value may lie between two
  size_t values = 0, width = 0;
  double filled = 0;
  for (const double share : histogram.shares) {
    width = share > kMinFilled ? width + 1 : 0;
    if (width > kMaxWidth) return 0;
    if (width > 0) filled += share;
    if (width == 1) ++values;
  }
  return filled > kMostOfVolume ? values : 0;
}

namespace {

constexpr double kRareness = 0.6;     // exponent; 0.5 to 0.7 look alike, 0.8 and more show noise
constexpr double kMinShare = 1e-5;    // of the largest: rarer values are not more opaque
constexpr double kClearedPart = 0.8;  // of the least extinction
constexpr int kModeBins = 4;          // on either side
constexpr int kClearBins = 3;
constexpr double kModeShare = 0.9;
constexpr double kLargestDepth = 2.3;
constexpr double kOutlyingPart = 0.005;
constexpr size_t kMaxPoints = 24;
constexpr double kRelativeError = 0.15, kMeanError = 0.1;
constexpr double kEmptyShare = 1e-9;

constexpr auto kBins = VolumeHistogram::kBins;

size_t distanceOf(size_t a, size_t b) {
  return a > b ? a - b : b - a;
}

/// The values of the bins as a function of the coordinate, linear between their middles.
double interpolated(const VolumeHistogram& histogram, const BinExtinctions& values, double coordinate) {
  const double x =
      (coordinate - histogram.low) / (histogram.high - histogram.low) * static_cast<double>(kBins) - 0.5;
  const double inside = std::clamp(x, 0.0, static_cast<double>(kBins - 1));
  const auto bin = std::min(static_cast<size_t>(inside), kBins - 2);
  return std::lerp(values[bin], values[bin + 1], inside - static_cast<double>(bin));
}

double opacityOf(double extinction) {
  return -std::expm1(-kLargestDepth * extinction);
}

/// The mean opacity of the volume whose coordinates are in [from, to); `none` if there is no volume.
double meanOpacity(const VolumeHistogram& histogram, const BinExtinctions& extinctions, double from,
                   double to, double none) {
  double share = 0, sum = 0;
  for (size_t bin = 0; bin < kBins; ++bin) {
    if (histogram.middle(bin) < from || histogram.middle(bin) >= to) continue;
    share += histogram.shares[bin];
    sum += histogram.shares[bin] * opacityOf(extinctions[bin]);
  }
  return share > 0 ? sum / share : none;
}

}  // namespace

BinExtinctions extinctionsOf(const VolumeHistogram& histogram) {
  const auto& smoothed = histogram.smoothed;
  const auto mode =
      static_cast<size_t>(std::max_element(smoothed.begin(), smoothed.end()) - smoothed.begin());
  BinExtinctions result{};
  for (size_t bin = 0; bin < kBins; ++bin)
    result[bin] = std::pow(smoothed[bin] + kMinShare * smoothed[mode], -kRareness);

  double around_mode = 0, clear = 0, least = result[mode];
  for (size_t bin = 0; bin < kBins; ++bin) {
    if (distanceOf(bin, mode) <= kModeBins) around_mode += histogram.shares[bin];
    if (distanceOf(bin, mode) <= kClearBins) clear = std::max(clear, result[bin]);
    least = std::min(least, result[bin]);
  }
  double largest = 0;
  for (size_t bin = 0; bin < kBins; ++bin) {
    if (around_mode > kModeShare)
      result[bin] = distanceOf(bin, mode) <= kClearBins ? 0 : std::max(0.0, result[bin] - clear);
    else
      result[bin] -= kClearedPart * least;
    largest = std::max(largest, result[bin]);
  }
  if (!(largest > 0)) largest = 1;
  for (double& extinction : result) extinction /= largest;
  return result;
}

namespace {

/// The coordinate below which `part` of the bins' weights lie, each spread evenly over its bin.
double percentileOf(const VolumeHistogram& histogram, const BinWeights& weights, double part) {
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  const double bin_width = (histogram.high - histogram.low) / static_cast<double>(kBins);
  double sum = 0;
  for (size_t bin = 0; bin < kBins; ++bin) {
    const double here = weights[bin] / total;
    if (sum + here >= part && here > 0)
      return histogram.low + (static_cast<double>(bin) + (part - sum) / here) * bin_width;
    sum += here;
  }
  return histogram.high;
}

}  // namespace

std::pair<double, double> seenInterval(const VolumeHistogram& histogram, const BinExtinctions& extinctions) {
  BinWeights weights;
  for (size_t bin = 0; bin < kBins; ++bin) weights[bin] = histogram.shares[bin] * extinctions[bin];
  if (!(std::accumulate(weights.begin(), weights.end(), 0.0) > 0)) return {histogram.low, histogram.high};
  return {percentileOf(histogram, weights, kOutlyingPart),
          percentileOf(histogram, weights, 1 - kOutlyingPart)};
}

std::optional<std::pair<double, double>> narrowedInterval(const VolumeHistogram& histogram,
                                                          const BinWeights& seen, double begin, double end,
                                                          std::optional<double> middle) {
  constexpr double kBeyond = 0.01, kNarrow = 0.55;
  if (!(std::accumulate(seen.begin(), seen.end(), 0.0) > 0)) return std::nullopt;
  double low = std::max(begin, percentileOf(histogram, seen, kBeyond));
  double high = std::min(end, percentileOf(histogram, seen, 1 - kBeyond));
  if (middle) {
    const double reach = std::max(*middle - low, high - *middle);
    low = *middle - reach;
    high = *middle + reach;
  }
  if (!(low < high && high - low < kNarrow * (end - begin))) return std::nullopt;
  return std::pair(low, high);
}

std::vector<OpacityPoint> opacityPoints(const VolumeHistogram& histogram, const BinExtinctions& extinctions,
                                        double begin, double end) {
  // The curve at many places, then the fewest of them that keep its shape: always the place that is farthest
  // off is added.
  constexpr size_t kPlaces = 257;
  std::vector<double> opacities(kPlaces), allowed(kPlaces);
  double mean = 0;
  for (size_t bin = 0; bin < kBins; ++bin) mean += histogram.shares[bin] * opacityOf(extinctions[bin]);
  for (size_t n = 0; n < kPlaces; ++n) {
    const double coordinate = std::lerp(begin, end, static_cast<double>(n) / (kPlaces - 1));
    opacities[n] = opacityOf(interpolated(histogram, extinctions, coordinate));
    // Values that nothing has may have any opacity.
    const bool empty = interpolated(histogram, histogram.smoothed, coordinate) < kEmptyShare;
    allowed[n] = empty ? 1 : kRelativeError * opacities[n] + kMeanError * mean;
  }
  // Values beyond the ends are drawn with the opacity of the ends. Where most of the volume lies there and is clear, it
  // has to stay clear: the far field of a vortex.
  const auto end_at = [&](size_t place, double from, double to) {
    opacities[place] =
        std::min(opacities[place], meanOpacity(histogram, extinctions, from, to, opacities[place]));
    allowed[place] = kRelativeError * opacities[place] + kMeanError * mean;
  };
  end_at(0, -HUGE_VAL, begin);
  end_at(kPlaces - 1, end, HUGE_VAL);
  std::vector<size_t> kept{0, kPlaces - 1};
  while (kept.size() < kMaxPoints) {
    size_t worst = 0;
    double worst_error = 1;
    for (size_t piece = 1; piece < kept.size(); ++piece) {
      const size_t from = kept[piece - 1], to = kept[piece];
      for (size_t n = from + 1; n < to; ++n) {
        const double part = static_cast<double>(n - from) / static_cast<double>(to - from);
        const double error =
            std::abs(std::lerp(opacities[from], opacities[to], part) - opacities[n]) / allowed[n];
        if (error <= worst_error) continue;
        worst_error = error;
        worst = n;
      }
    }
    if (worst == 0) break;
    kept.insert(std::upper_bound(kept.begin(), kept.end(), worst), worst);
  }
  std::vector<OpacityPoint> points;
  for (const size_t n : kept)
    points.push_back({roundedTo(static_cast<double>(n) / (kPlaces - 1), 1, 4),
                      opacities[n] > 0 ? roundedTo(opacities[n], opacities[n], 2) : 0});
  return points;
}

std::vector<OpacityPoint> raisedTo(double least, std::vector<OpacityPoint> points) {
  least = roundedTo(least, least, 2);
  for (OpacityPoint& point : points) point.opacity = std::max(point.opacity, least);
  return points;
}

}  // namespace curvisplat
