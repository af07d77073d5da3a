// Computes a scalar's histogram from the coarse bricks of a cache; fast for any cache size.
#pragma once

#include <cstddef>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Returns the fraction of the data's volume in each of `bins` bins of [low, high], of equal width on a
/// linear or logarithmic scale. Reads the coarsest level with at least 20,000 splats, or the finest level.
/// Requires low < high, and low > 0 on a logarithmic scale. Throws Error as reading does.
std::vector<double> histogramOf(const CacheReader& cache, size_t variable, double low, double high,
                                bool log_scale, size_t bins);

}  // namespace curvisplat
