// What adding a scalar and adding a step begin with.
#pragma once

#include <filesystem>

#include "preprocess/grid/grid_source.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Throws Error if the grid's blocks are not those of the cache, which tells at once that it is another grid.
void checkBlocks(const GridDescription& grid, const CacheReader& cache);

/// A new name in `folder` for the temporary files of an addition to `cache`, which is locked. Removes those of
/// additions that were killed.
std::filesystem::path newScratch(const std::filesystem::path& cache, const std::filesystem::path& folder);

}  // namespace curvisplat
