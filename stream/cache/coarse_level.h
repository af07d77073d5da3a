// The bricks of one level of a cache: what stands for all of its data where few splats are enough. Pure; any
// thread.
#pragma once

#include <cstdint>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The bricks of the coarsest level with at least `min_splats` splats, including leaves above that level.
std::vector<uint32_t> bricksAtALevel(const CacheReader& cache, uint64_t min_splats);

}  // namespace curvisplat
