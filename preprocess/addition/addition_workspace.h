// Begins an addition of scalars or of a time step: the cache's lock and a folder for temporary files, which
// it holds while it works, and checks that the grid is the cache's. If several ranks add together, rank 0
// holds the lock, and each has a folder of its own in rank 0's. One thread calls.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"

namespace curvisplat {

/// The cache's lock and the temporary folder.
class AdditionWorkspace {
 public:
  /// Locks the cache, and removes the temporary files of additions that were killed. All ranks call it.
  /// Throws Error if another program is changing the cache, or if a rank does not see the folder.
  AdditionWorkspace(const std::filesystem::path& cache, const std::filesystem::path& temporary_folder,
                    Ranks& ranks);
  /// Removes the folder.
  ~AdditionWorkspace();
  AdditionWorkspace(const AdditionWorkspace&) = delete;
  AdditionWorkspace& operator=(const AdditionWorkspace&) = delete;

  /// The lock, at rank 0 only.
  const CacheLock& lock() const { return *lock_; }
  /// The folder that all ranks see.
  const std::filesystem::path& shared() const { return shared_; }
  /// The folder of this rank alone.
  const std::filesystem::path& own() const { return own_; }

 private:
  std::optional<CacheLock> lock_;  // before the folder is made
  std::unique_ptr<ScratchFolder> folder_;
  std::filesystem::path shared_, own_;
};

/// Throws Error if number or sizes of the grid's blocks differ from the cache's: then it is a different
/// grid.
void checkBlocks(const std::vector<GridBlock>& grid, const CacheReader& cache);

/// checkBlocks() for a time step's grid: the message names the blocks that the step has in addition to those
/// of earlier steps, or lacks.
void checkBlocksOfStep(const std::vector<GridBlock>& grid, const Manifest& series);

/// The overlaps of the grid's blocks where `cache` draws each point once; else none. Rank 0
/// looks for them, and all get them. Throws Error if the grid cannot be read.
std::vector<BlockOverlap> overlapsFor(const Manifest& cache, const GridSource& grid,
                                      const OverlapMemory& memory, const Progress& progress,
                                      Ranks& ranks = oneRank());

/// A new name in `folder` for the temporary files of an addition to `cache`, which is locked. Removes those
/// of additions that were killed.
std::filesystem::path newScratch(const std::filesystem::path& cache, const std::filesystem::path& folder);

}  // namespace curvisplat
