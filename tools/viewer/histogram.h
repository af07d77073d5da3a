// How a scalar is spread over a cache, from its coarsest bricks: quick at any size.
#pragma once

#include <cstddef>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Volume of the data in each of `bins` equal parts of [low, high], as a fraction of all of it; in equal
/// parts of the logarithm if `log_scale`. Reads the coarsest level that has 20,000 splats or more, or the
/// finest. Throws Error as reading does. Requires low < high, above zero for a logarithm.
std::vector<double> histogramOf(const CacheReader& cache, size_t variable, double low, double high,
                                bool log_scale, size_t bins);

}  // namespace curvisplat
