// The passes that make bricks, on several ranks:
//
//   build   each rank builds the buckets of a range in Morton order, into files of its own in the scratch folder,
//           with all cells above them that lie in its range as a whole
//   join    rank 0 merges the cells that lie in the ranges of several ranks, puts all bricks into post-order and
//           gives each its place in the cache's files; each rank copies its streams there
//
// The cache's bytes are those of one rank. Rank 0 has a few hundred bytes of memory for each brick twice.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "preprocess/convert/bucket_loader.h"
#include "preprocess/convert/bucket_tree.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/manifest.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// [rank]: its buckets, about as many splats for each. No cell that is built as a whole lies in two ranges. The tree
/// has contents.
std::vector<BucketRange> dealBuckets(const BucketTree& tree, uint32_t buckets, unsigned ranks);

/// The cache that a rank writes its bricks to, which never gets a manifest: NAME of NAME.partial.
std::filesystem::path bricksOfRank(const std::filesystem::path& scratch, unsigned rank);

struct SharedBuild {
  RootCube root;
  const std::vector<VariableInfo>& variables;
  const BucketTree& tree;         // with contents
  std::filesystem::path scratch;  // seen by all ranks
  std::filesystem::path partial;  // the folder of the cache, seen by all ranks
};

/// Joins the bricks that all ranks have built. `own`: the writer to bricksOfRank(); `whole`: the cache's, which has
/// no brick yet, at rank 0; null elsewhere. All have to call it. Throws Error if a disk fails, or if the file system
/// does not show what another rank has written.
void joinBricks(const SharedBuild& build, CacheWriter& own, CacheWriter* whole, Ranks& ranks);

}  // namespace curvisplat
