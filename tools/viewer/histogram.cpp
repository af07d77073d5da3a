#include "tools/viewer/histogram.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "render/automatic/coarse_samples.h"
#include "stream/cache/series_histogram.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMinSplats = 20'000;

/// The volume of `stored` in `bins` bins of the function's coordinate. Nothing if one of its bins in the function's
/// range is wider than one of these.
std::optional<std::vector<double>> dividedAnew(const ValueHistogram& stored, const EditedFunction& function,
                                               size_t bins) {
  const auto [low, high] = function.range();
  const auto count = static_cast<double>(bins);
  const auto binAt = [&](double value) { return std::clamp(function.coordinateOf(value), 0.0, 1.0) * count; };
  std::vector<double> shares(bins, 0.0);
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    const double width = stored.binWidth();
    const double begin = stored.lower + static_cast<double>(bin) * width, end = begin + width;
    if (end < low || begin > high) continue;
    const double inside_begin = std::max(begin, low), inside_end = std::min(end, high);
    const double first = binAt(inside_begin), last = binAt(inside_end);
    if (last - first > 1) return std::nullopt;
    const double share =
        width > 0 ? stored.shares[bin] * (inside_end - inside_begin) / width : double{stored.shares[bin]};
    // It lies in one bin, or in two that follow one another.
    const auto own = std::min(bins - 1, static_cast<size_t>(first));
    const double in_own =
        last > first ? std::min(1.0, (static_cast<double>(own + 1) - first) / (last - first)) : 1;
    shares[own] += share * in_own;
    shares[std::min(bins - 1, own + 1)] += share * (1 - in_own);
  }
  return shares;
}

}  // namespace

std::vector<double> histogramOf(const CacheReader& cache, size_t variable, const EditedFunction& function,
                                size_t bins) {
  if (const auto stored = stepHistogram(cache, variable))
    if (auto shares = dividedAnew(*stored, function, bins)) return *std::move(shares);
  const auto [low, high] = function.range();
  std::vector<double> volumes(bins, 0.0);
  double total = 0;
  SplatGeometry geometry;
  SplatVariable values;
  for (const uint32_t brick : bricksAtALevel(cache, kMinSplats)) {
    try {
      cache.readGeometry(brick, geometry);
      cache.readVariable(brick, variable, values);
    } catch (const DamagedBrick&) {
      continue;  // drawing it reports it
    }
    for (size_t n = 0; n < values.size(); ++n) {
      total += geometry.weight[n];
      const double value = values.mean[n];
      if (!(value >= low && value <= high)) continue;
      const double part = std::clamp(function.coordinateOf(value), 0.0, 1.0);
      volumes[std::min(bins - 1, static_cast<size_t>(part * static_cast<double>(bins)))] +=
          geometry.weight[n];
    }
  }
  if (total > 0)
    for (double& volume : volumes) volume /= total;
  return volumes;
}

}  // namespace curvisplat
