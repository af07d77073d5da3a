// What adding a scalar and adding a step begin with.
#pragma once

#include <filesystem>

#include "preprocess/grid/grid_source.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Throws Error if number or sizes of the grid's blocks differ from the cache's: then it is a different grid.
void checkBlocks(const std::vector<GridBlock>& grid, const CacheReader& cache);

/// The same of a time step's grid: the message names the blocks that the steps before it lack, or have besides.
void checkBlocksOfStep(const std::vector<GridBlock>& grid, const Manifest& series);

/// The overlaps of the grid's blocks where `cache` draws each point once; else none. With `ranks` rank 0 looks for them, and
/// all get them. Throws Error if the grid cannot be read.
std::vector<BlockOverlap> overlapsFor(const Manifest& cache, const GridSource& grid,
                                      const OverlapMemory& memory, const Progress& progress,
                                      Ranks* ranks = nullptr);

/// A new name in `folder` for the temporary files of an addition to `cache`, which is locked. Removes those of
/// additions that were killed.
std::filesystem::path newScratch(const std::filesystem::path& cache, const std::filesystem::path& folder);

}  // namespace curvisplat
