// The plan of the scatter pass: which cells of the octree go to which bucket.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/counting_grid.h"
#include "preprocess/convert/memory_plan.h"

namespace curvisplat {

/// As BucketTree::assignBuckets, with at most `most_buckets`: where `capacity` would make more, buckets are
/// larger, and are divided again when they are built.
uint32_t assignBucketsWithin(BucketTree& tree, const std::vector<uint32_t>& leaves,
                             const std::function<uint64_t(uint32_t leaf)>& count, uint64_t capacity,
                             uint32_t most_buckets);

/// Splits the root down to cells that fit a bucket, as far as the counts go, and assigns their buckets.
/// Returns the number of buckets.
uint32_t planBuckets(const CountingGrid& counts, const MemoryPlan& plan, BucketTree& tree);

}  // namespace curvisplat
