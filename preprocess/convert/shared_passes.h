// The exchange between ranks that convert together: in the passes up to "seams" plans, surveys, counts
// and trees; and how their bricks become one cache. The cache's bytes are those of one rank. All ranks have
// to call a function that takes a Ranks& which is not const.
//
//   build   each rank builds the buckets of a range in Morton order, into files of its own in the scratch
//           folder, with all cells above them that lie in its range as a whole
//   join    rank 0 merges the cells that lie in the ranges of several ranks, puts all bricks into post-order
//           and gives each its place in the cache's files; each rank copies its streams there
//
// Rank 0 has a few hundred bytes of memory for each brick twice.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "preprocess/convert/bucket_builds.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/manifest.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// A rank's share of slabs.
inline SlabShare shareOf(const Ranks& ranks) {
  return {ranks.rank(), ranks.count()};
}

/// The size of slabs, in bytes, with which each of several ranks gets about eight; at most `slab_bytes`, at
/// least what a row and its halo need.
uint64_t slabBytesOfRanks(const NodeReader& reader, uint64_t slab_bytes, const Ranks& ranks);

/// The plan of all ranks, which must cut the grid and the buckets alike: of each number the smallest that any
/// rank has. Limit and threads stay each rank's own.
MemoryPlan commonPlan(MemoryPlan plan, Ranks& ranks);

/// Combines the ranks' surveys of their shares into one of the whole grid, at every rank.
GridSurvey combinedSurvey(const GridSurvey& share, Ranks& ranks);
/// Returns rank 0's survey at every rank.
GridSurvey broadcastSurvey(const GridSurvey& survey, Ranks& ranks);

/// Adds the counts of all other ranks to rank 0's, rank after rank, so that rank 0 holds the runs of only one
/// other rank at a time.
void sendCountsToFirst(CountingGrid& counts, Ranks& ranks);

/// Returns rank 0's tree, without contents, at every rank.
BucketTree broadcastTree(const BucketTree& tree, Ranks& ranks);
/// Replaces `contents`, [node of the tree], by the sums of all ranks' contents, at every rank.
void sumContents(std::vector<CellContents>& contents, Ranks& ranks);

/// Returns at rank 0 the chains of the other ranks' files, from rank 1 on.
std::vector<BucketChains> gatherChains(const BucketChains& chains, Ranks& ranks);

/// [rank]: its buckets, about as many splats for each. No cell that is built as a whole lies in two ranges.
/// The tree has contents.
std::vector<BucketRange> dealBuckets(const BucketTree& tree, uint32_t buckets, unsigned ranks);

/// The cache that a rank writes its bricks to, which never gets a manifest: NAME of NAME.partial.
std::filesystem::path bricksOfRank(const std::filesystem::path& scratch, unsigned rank);

/// The facts that joinBricks() needs about the build.
struct SharedBuild {
  RootCube root;
  const std::vector<VariableInfo>& variables;
  const std::vector<ValueCoding>& codings;  // [variable]
  const BucketTree& tree;                   // with contents
  std::filesystem::path scratch;            // seen by all ranks
  std::filesystem::path partial;            // the folder of the cache, seen by all ranks
};

/// Joins the bricks that all ranks have built. `own`: the writer to bricksOfRank(); `whole`: the cache's,
/// which has no brick yet, at rank 0; null elsewhere. All have to call it. Throws Error if a disk fails, or
/// if the file system does not show what another rank has written.
void joinBricks(const SharedBuild& build, CacheWriter& own, CacheWriter* whole, Ranks& ranks);

}  // namespace curvisplat
