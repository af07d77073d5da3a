#include "preprocess/convert/bucket_plan.h"

#include <algorithm>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
void CellContents::add(const RootPosition& position) {
  ++splats;
  for (int axis = 0; axis < 3; ++axis) {
    lower.at[axis] = std::min(lower.at[axis], position.at[axis]);
    upper.at[axis] = std::max(upper.at[axis], position.at[axis]);
  }
}

void CellContents::add(const CellContents& other) {
  splats += other.splats;
  for (int axis = 0; axis < 3; ++axis) {
    lower.at[axis] = std::min(lower.at[axis], other.lower.at[axis]);
    upper.at[axis] = std::max(upper.at[axis], other.upper.at[axis]);
  }
}

uint32_t BucketTree::leafOf(const RootPosition& position) const {
  uint32_t node = 0;
  while (!nodes_[node].isLeaf())
    node = nodes_[node].first_child + static_cast<uint32_t>(octantOf(position, nodes_[node].cell));
  return node;
}

uint32_t BucketTree::nodeOf(const Cell& cell) const {
  RootPosition corner;
  for (int axis = 0; axis < 3; ++axis)
    corner.at[axis] = uint64_t{cell.at[axis]} << (kPositionBits - cell.level);
  uint32_t node = 0;
  while (nodes_[node].cell.level < cell.level) {
    if (nodes_[node].isLeaf()) return kNone;
    node = nodes_[node].first_child + static_cast<uint32_t>(octantOf(corner, nodes_[node].cell));
  }
  return node;
}

void BucketTree::split(uint32_t leaf, const std::function<uint64_t(const Cell&)>& count, uint64_t capacity,
                       uint32_t deepest) {
  const Cell cell = nodes_[leaf].cell;
  if (cell.level >= deepest || count(cell) <= capacity) return;
  const auto first_child = static_cast<uint32_t>(nodes_.size());
  nodes_[leaf].first_child = first_child;
  nodes_[leaf].bucket = kNone;
  for (int octant = 0; octant < 8; ++octant) {
    nodes_.push_back({});
    nodes_.back().cell = cell.child(octant);
    nodes_.back().parent = leaf;
  }
  for (uint32_t octant = 0; octant < 8; ++octant) split(first_child + octant, count, capacity, deepest);
}

std::vector<uint32_t> BucketTree::leavesBelow(uint32_t node) const {
  std::vector<uint32_t> leaves, pending{node};
  while (!pending.empty()) {
    const uint32_t next = pending.back();
    pending.pop_back();
    if (nodes_[next].isLeaf()) {
      leaves.push_back(next);
      continue;
    }
    for (uint32_t octant = 8; octant-- > 0;) pending.push_back(nodes_[next].first_child + octant);
  }
  return leaves;
}

uint32_t BucketTree::assignBuckets(const std::vector<uint32_t>& leaves,
                                   const std::function<uint64_t(uint32_t)>& count, uint64_t capacity) {
  uint32_t bucket = 0;
  uint64_t in_bucket = 0;
  for (const uint32_t leaf : leaves) {
    const uint64_t in_leaf = count(leaf);
    if (in_bucket > 0 && in_bucket + in_leaf > capacity) {
      ++bucket;
      in_bucket = 0;
    }
    nodes_[leaf].bucket = bucket;
    in_bucket += in_leaf;
  }
  return bucket + 1;
}

void BucketTree::setContents(const std::vector<uint32_t>& leaves, const std::vector<CellContents>& contents) {
  for (const uint32_t leaf : leaves) nodes_[leaf].contents = contents[leaf];
  // Children have higher numbers than their parent.
  for (uint32_t node = static_cast<uint32_t>(nodes_.size()); node-- > 0;) {
    if (nodes_[node].isLeaf()) continue;
    CellContents sum;
    for (uint32_t octant = 0; octant < 8; ++octant)
      sum.add(nodes_[nodes_[node].first_child + octant].contents);
    nodes_[node].contents = sum;
  }
}

std::vector<BucketTree::Link> BucketTree::links() const {
  std::vector<Link> links;
  for (const Node& node : nodes_) links.push_back({node.first_child, node.bucket});
  return links;
}

BucketTree BucketTree::fromLinks(const std::vector<Link>& links) {
  BucketTree tree;
  // Children have higher numbers than their parent.
  tree.nodes_.resize(links.size());
  for (uint32_t node = 0; node < links.size(); ++node) {
    tree.nodes_[node].first_child = links[node].first_child;
    tree.nodes_[node].bucket = links[node].bucket;
    if (tree.nodes_[node].isLeaf()) continue;
    for (uint32_t octant = 0; octant < 8; ++octant) {
      Node& child = tree.nodes_[links[node].first_child + octant];
      child.parent = node;
      child.cell = tree.nodes_[node].cell.child(static_cast<int>(octant));
    }
  }
  return tree;
}

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
