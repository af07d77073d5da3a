#include "preprocess/convert/plan_buckets.h"

namespace curvisplat {

uint32_t assignBucketsWithin(BucketTree& tree, const std::vector<uint32_t>& leaves,
                             const std::function<uint64_t(uint32_t)>& count, uint64_t capacity,
                             uint32_t most_buckets) {
  uint32_t buckets = tree.assignBuckets(leaves, count, capacity);
  while (buckets > most_buckets) {
    capacity *= 2;
    buckets = tree.assignBuckets(leaves, count, capacity);
  }
  return buckets;
}

uint32_t planBuckets(const CountingGrid& counts, const MemoryPlan& plan, BucketTree& tree) {
  const auto countOfCell = [&](const Cell& cell) { return counts.count(cell); };
  tree.split(0, countOfCell, plan.plannedBucketSplats(), counts.level());
  const auto countOfLeaf = [&](uint32_t leaf) { return counts.count(tree[leaf].cell); };
  return assignBucketsWithin(tree, tree.leavesBelow(0), countOfLeaf, plan.plannedBucketSplats(),
                             plan.most_buckets);
}

}  // namespace curvisplat
