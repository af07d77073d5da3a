// A scalar's histogram at the step of a reader, from the one in the cache, or from coarse bricks; fast for any cache
// size.
#pragma once

#include <cstddef>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/edited_function.h"

namespace curvisplat {

/// Returns the fraction of the data's volume in each of `bins` bins of [0, 1], of the scalar's coordinate along the
/// function's range. Of the finest splats, from the cache's own histogram, where its bins are fine enough for the range. Otherwise
/// reads the coarsest level with at least 20,000 splats, or the finest level, without bricks that are damaged. Throws
/// Error if the disk fails.
std::vector<double> histogramOf(const CacheReader& cache, size_t variable, const EditedFunction& function,
                                size_t bins);

}  // namespace curvisplat
