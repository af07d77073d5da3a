#include "tools/viewer/histogram.h"

#include <algorithm>
#include <cmath>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMinSplats = 20'000;

/// The bricks of the coarsest level with at least kMinSplats splats, including leaves above that level.
std::vector<uint32_t> bricksAtALevel(const CacheReader& cache) {
  const auto bricks = cache.bricks();
  for (uint32_t level = 0;; ++level) {
    std::vector<uint32_t> chosen;
    uint64_t splats = 0;
    bool deeper = false;
    for (uint32_t n = 0; n < bricks.size(); ++n) {
      const uint32_t own = bricks[n].cell.level;
      if (own == level || (own < level && bricks[n].isLeaf())) {
        chosen.push_back(n);
        splats += bricks[n].splats;
      }
      deeper |= own > level;
    }
    if (splats >= kMinSplats || !deeper) return chosen;
  }
}

}  // namespace

std::vector<double> histogramOf(const CacheReader& cache, size_t variable, double low, double high,
                                bool log_scale, size_t bins) {
  CURVISPLAT_CHECK_OP(low, <, high);
  CURVISPLAT_CHECK(!log_scale || low > 0);
  std::vector<double> volumes(bins, 0.0);
  double total = 0;
  SplatGeometry geometry;
  SplatVariable values;
  for (const uint32_t brick : bricksAtALevel(cache)) {
    cache.readGeometry(brick, geometry);
    cache.readVariable(brick, variable, values);
    for (size_t n = 0; n < values.size(); ++n) {
      total += geometry.weight[n];
      const double value = values.mean[n];
      if (!(value >= low && value <= high)) continue;
      const double part =
          log_scale ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
      volumes[std::min(bins - 1, static_cast<size_t>(part * static_cast<double>(bins)))] +=
          geometry.weight[n];
    }
  }
  if (total > 0)
    for (double& volume : volumes) volume /= total;
  return volumes;
}

}  // namespace curvisplat
