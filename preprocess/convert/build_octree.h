// The pass that makes the cache's bricks: bucket after bucket in Morton order, and the levels above as soon
// as the last of their children is there.
//
//    BucketFile --loader--> records of a bucket --BucketBuilds, CellBuilder--> bricks --in order--> CacheWriter
//                  |                                                                                   |
//                  +-- too large: divided into a temporary file of its own                readBack, merge, append
//
// Bricks come out in post-order of the octree whatever the buckets are. So the bricks that an interrupted
// conversion has appended are the first ones of any other's, and only the rest is built: from the first
// bucket on that has a cell whose bricks are not all there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "preprocess/convert/bucket_builds.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/build_cell.h"
#include "preprocess/convert/memory_plan.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_writer.h"

namespace curvisplat {

/// The data that bricks are built of, and the means.
struct OctreePlan {
  const RootCube& root;
  const std::vector<GridBlock>& blocks;
  const MemoryPlan& memory;
  std::filesystem::path temporary_folder;
  std::vector<ValueCoding> codings;  // [variable]
};

class OctreeBuilder {
 public:
  /// All references must outlive it. `tree` grows where a bucket has to be divided.
  OctreeBuilder(const OctreePlan& plan, BucketTree& tree, CacheWriter& writer, Progress& progress);

  /// Takes the writer's bricks for those of the first cells of the tree, and merges what these complete. Returns the
  /// first bucket with more to build, of `buckets`; their number if there is nothing.
  uint32_t takeUpBricks(uint32_t buckets);
  /// Builds and appends the buckets of `file`, which holds the splats of all of the tree, from `first` on. Throws
  /// Error if a disk fails.
  void build(const BucketFile& file, uint32_t first);
  /// The same for the buckets first .. end - 1, into a writer that has nothing: their bricks, and those of all
  /// cells above them that lie in these buckets as a whole.
  void buildShare(const BucketFile& file, uint32_t first, uint32_t end);

 private:
  /// The bricks that were appended for a node of the tree.
  struct Built {
    uint64_t first_brick = 0, bricks = 0;
    double error = 0;
  };

  void matchBricks();
  uint32_t finishTakenUp(const std::vector<uint32_t>& leaves, uint32_t buckets);
  uint64_t bricksOf(uint32_t node) const;
  bool isBuilt(uint32_t node) const { return node < built_.size() && built_[node].bricks > 0; }
  void buildBuckets(const BucketFile& file, const std::vector<uint32_t>& leaves, uint32_t first,
                    uint32_t end);
  std::optional<uint32_t> buildLoaded(const BucketFile& file, const BucketRange& buckets);
  BucketJobs jobsOf(LoadedBucket& loaded);
  void buildTooLarge(const BucketFile& file, uint32_t bucket, const std::vector<uint32_t>& leaves);
  void buildCoincident(const BucketFile& file, uint32_t bucket, uint32_t leaf);
  void append(uint32_t node, BuiltCell&& cell);
  void completeParents(uint32_t node);
  void buildParent(uint32_t node);
  bool childrenAreBuilt(uint32_t node) const;

  const RootCube root_;
  const size_t variables_;
  const std::vector<ValueCoding> codings_;
  const MemoryPlan plan_;
  BucketTree* tree_;
  CacheWriter* writer_;
  const std::filesystem::path temporary_folder_;
  Progress* progress_;
  CellBuilder cells_;
  std::vector<Built> built_;  // [node of the tree]
  // Cells that fit a brick but whose records lie in several buckets: what was seen of them so far.
  std::map<uint32_t, std::vector<std::byte>> carried_;
  unsigned files_made_ = 0;
};

}  // namespace curvisplat
