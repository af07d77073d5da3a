// The passes that bring the values of scalars to the bricks of a cache whose geometry is that of the grid: what
// adding a scalar and adding a time step have in common.
//
//   scatter   the grid's splats go to buckets of bricks; those of block faces to the seam merger
//   seams     the merged splats of block faces follow
//   build     bucket after bucket, the streams
//
// Several ranks scatter together: each a share of the grid, into a file of its own. Rank 0 merges the seams and builds,
// from all ranks' files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "preprocess/addition/conversion_order.h"
#include "preprocess/addition/step_references.h"
#include "preprocess/addition/value_buckets.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/seams.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {

/// For one thread, which calls the passes in order.
class ValuePasses {
 public:
  /// All references must outlive it. `scratch`: a folder for temporary files.
  ValuePasses(const CacheReader& cache, size_t variables, const MemoryPlan& plan,
              std::filesystem::path scratch, Progress& progress);

  /// Before scatter(): all ranks call scatter() and mergeSeams() together, and rank 0 alone build(). `shared`: a folder
  /// for temporary files that all of them see. The plan has to be the same at all ranks (commonPlan()).
  void shareWith(Ranks& ranks, std::filesystem::path shared);
  /// Before scatter(): the overlaps of the grid's blocks, for a cache in which each point is drawn once.
  void setOverlaps(std::vector<BlockOverlap> overlaps) { overlaps_ = std::move(overlaps); }
  /// `see`: as SlabPass has it. Throws Error if the cache has no cell for a splat.
  void scatter(const NodeReader& reader, std::function<void(const LoadedSlab&)> see = {});
  /// Of an unstructured grid, after its survey(); rank 0 makes all its splats.
  void scatter(SplatOrigin& origin);
  void mergeSeams();
  /// `references`: what the values are predicted from; may be null. Throws Error if the splats are not those of the
  /// cache.
  void build(ValuesWriter& writer, const StepReferences* references = nullptr);

  /// Of the scattered values of all ranks, after mergeSeams(); at rank 0.
  uint64_t temporaryBytes() const { return temporary_bytes_; }

 private:
  bool isFirst() const { return !ranks_ || ranks_->isFirst(); }
  std::filesystem::path fileOf(unsigned rank) const;
  void openFile();
  void joinFiles();
  ValueSink newSink() const { return {*cache_, order_, buckets_, grouped_, *file_}; }

  const CacheReader* cache_;
  const size_t variables_;
  const MemoryPlan plan_;
  const std::filesystem::path scratch_;
  Progress* progress_;
  Ranks* ranks_ = nullptr;        // null: this process alone
  std::filesystem::path shared_;  // of all ranks
  const ConversionOrder order_;
  const ValueBuckets buckets_;
  const uint32_t grouped_;
  std::vector<BlockOverlap> overlaps_;
  std::unique_ptr<BucketFile> file_;
  std::unique_ptr<SeamMerger> seams_;
  int coordinate_bytes_ = 0;
  uint64_t temporary_bytes_ = 0;
};

}  // namespace curvisplat
