// A grid restricted to the nodes that a cache draws, whichever scalars are read from it now: nodes without a
// splat in the cache are blanked, so that every splat comes out as it did when the cache was made. With
// cell-centred scalars, cells without a splat in the cache have the value NaN.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "preprocess/addition/drawn_nodes.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/splats/joint_nodes.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// What the conversion that made a cache did with coincident halves of unlike thickness.
UnlikeHalves unlikeHalvesOf(const Manifest& manifest);

class CacheGrid : public GridSource {
 public:
  /// What the grid itself blanks: iblank, and coordinates that are not finite. Enough for a cache whose
  /// scalars had values everywhere else. `source` must outlive it.
  explicit CacheGrid(const GridSource& source);

  /// Blanks nodes that `cache` has no splat of, too. Throws Error if a disk fails.
  void restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                  const std::filesystem::path& temporary_folder, Progress& progress);
  /// Restores the nodes that were merged into others at seams, by merging the grid's faces again. To be called
  /// after restrictTo(), while no other thread reads.
  void addMergedFaces(const MemoryPlan& plan, UnlikeHalves unlike,
                      const std::filesystem::path& temporary_folder, Progress& progress);

  const GridDescription& description() const override { return source_->description(); }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override;
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    return source_->rowsInMemory(scalars);
  }

 private:
  void blankOthers(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                   NodeArrays& out) const;
  void restrict(uint32_t block, const NodeBox& box, std::vector<uint8_t>& blank) const;

  const GridSource* source_;
  std::vector<uint64_t> first_nodes_;  // [block]
  std::unique_ptr<DrawnNodes> drawn_;
  bool is_steep_ = true;      // of the cache (kSteepStretch)
  bool cuts_octants_ = true;  // of the cache (kCellOctants)
  bool all_faces_ = false;    // while merged ones are looked for: nodes of block faces are not restricted
};

}  // namespace curvisplat
