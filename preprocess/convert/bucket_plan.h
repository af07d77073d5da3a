// The plan of the scatter pass: which cells of the octree go to which bucket. BucketTree is the top of the
// octree, down to cells that have few enough splats to be built in memory; its leaves belong to buckets.
// planBuckets() makes it from counts of positions (CountingGrid), within the memory plan.
//
// The counts only nearly tell where the splats will go (cells at block faces move their centres inwards,
// seams merge). What is built follows what was routed: the contents, which are exact. Not for several
// threads at once, except for const functions.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "stream/model/octree.h"
#include "stream/vdb/counting_grid.h"

namespace curvisplat {

/// Splats in a cell, and the box of their positions. Sums do not depend on their order.
struct CellContents {
  uint64_t splats = 0;
  RootPosition lower{{UINT64_MAX, UINT64_MAX, UINT64_MAX}}, upper{};

  void add(const RootPosition& position);
  void add(const CellContents& other);
  /// All splats are at one position: splitting the cell would never part them.
  bool coincide() const { return splats > 0 && lower == upper; }
};

/// The top of the octree: down to cells that have few enough splats to be built in memory. Each of its
/// leaves belongs to a bucket; small neighbours, in Morton order, share one.
class BucketTree {
 public:
  static constexpr uint32_t kNone = 0xffffffff;

  struct Node {
    Cell cell;
    uint32_t parent = kNone;
    uint32_t first_child = kNone;  // eight, in Morton order
    uint32_t bucket = kNone;       // leaves
    CellContents contents;
    bool isLeaf() const { return first_child == kNone; }
  };

  /// A root that is a leaf.
  BucketTree() { nodes_.push_back({}); }

  size_t size() const { return nodes_.size(); }
  const Node& operator[](uint32_t node) const { return nodes_[node]; }

  /// The leaf that holds `position`.
  uint32_t leafOf(const RootPosition& position) const;
  /// The node of `cell`; kNone if the tree is not so deep there.
  uint32_t nodeOf(const Cell& cell) const;

  /// Splits `leaf` and its children as long as `count` of a cell is above `capacity`, down to `deepest`
  /// level.
  void split(uint32_t leaf, const std::function<uint64_t(const Cell&)>& count, uint64_t capacity,
             uint32_t deepest);

  /// The leaves below `node`, in Morton order; of a leaf: itself.
  std::vector<uint32_t> leavesBelow(uint32_t node) const;

  /// Gives each of `leaves` (in Morton order) its bucket, numbered from 0: neighbours share one as long as
  /// their `count` (of a leaf) stays within `capacity`. Returns the number of buckets.
  uint32_t assignBuckets(const std::vector<uint32_t>& leaves,
                         const std::function<uint64_t(uint32_t leaf)>& count, uint64_t capacity);

  /// Sets the contents of `leaves`, given for each node of the tree, and of all nodes above them.
  void setContents(const std::vector<uint32_t>& leaves, const std::vector<CellContents>& contents);

  /// A tree as numbers, and back: [node] first_child, or kNone and the bucket.
  struct Link {
    uint32_t first_child = kNone, bucket = kNone;
  };
  std::vector<Link> links() const;
  static BucketTree fromLinks(const std::vector<Link>& links);

 private:
  std::vector<Node> nodes_;
};

/// Assigns buckets as BucketTree::assignBuckets does, but at most `most_buckets`: where `capacity` would make
/// more, buckets are larger, and are divided again when they are built.
uint32_t assignBucketsWithin(BucketTree& tree, const std::vector<uint32_t>& leaves,
                             const std::function<uint64_t(uint32_t leaf)>& count, uint64_t capacity,
                             uint32_t most_buckets);

/// Splits the root down to cells that fit a bucket, as far as the counts go, and assigns their buckets.
/// Returns the number of buckets.
uint32_t planBuckets(const CountingGrid& counts, const MemoryPlan& plan, BucketTree& tree);

}  // namespace curvisplat
