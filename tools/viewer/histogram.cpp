#include "tools/viewer/histogram.h"

#include <algorithm>

#include "render/automatic/coarse_samples.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMinSplats = 20'000;

}  // namespace

std::vector<double> histogramOf(const CacheReader& cache, size_t variable, const EditedFunction& function,
                                size_t bins) {
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
