// What the ranks that convert together tell each other in the passes up to "seams".
#pragma once

#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/counting_grid.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/ranks.h"

namespace curvisplat {

/// A rank's share of slabs; all, where `ranks` is null.
inline SlabShare shareOf(const Ranks* ranks) {
  return ranks ? SlabShare{ranks->rank(), ranks->count()} : SlabShare{};
}

/// The size of slabs of which each rank gets about eight; at most `slab_bytes`, and as much as a row and its halo need.
uint64_t slabBytesOfRanks(const NodeReader& reader, uint64_t slab_bytes, const Ranks& ranks);

// All ranks have to call these.

/// The plan of all: the smallest that any of them has of each thing, since they have to cut the grid and the buckets
/// alike. Limit and threads stay each rank's own.
MemoryPlan commonPlan(MemoryPlan plan, Ranks& ranks);

/// The survey of the whole, of each rank's survey of its share.
GridSurvey combinedSurvey(const GridSurvey& share, Ranks& ranks);
/// Rank 0's survey, at every rank.
GridSurvey broadcastSurvey(const GridSurvey& survey, Ranks& ranks);

/// Adds the counts of all other ranks to rank 0's, one rank's after the other's. Costs rank 0 the memory of one
/// more grid's runs.
void sendCountsToFirst(CountingGrid& counts, Ranks& ranks);

/// Rank 0's tree, without contents, at every rank.
BucketTree broadcastTree(const BucketTree& tree, Ranks& ranks);
/// [node of the tree]: the sums of all ranks' contents, at every rank.
void sumContents(std::vector<CellContents>& contents, Ranks& ranks);

/// At rank 0: the chains of the other ranks' files, from rank 1 on.
std::vector<BucketChains> gatherChains(const BucketChains& chains, Ranks& ranks);

}  // namespace curvisplat
