// A cache's octree as conversion goes through it: bricks in post-order, the order in which their streams lie
// in the files, and the leaf brick that a node's splat is in.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// Numbers of nodes in the whole grid: block after block, i fastest, then j, k.
class NodeNumbers {
 public:
  explicit NodeNumbers(const std::vector<BlockInfo>& blocks);

  /// Of the first node of a run. Throws Error if the run is not in the grid.
  uint64_t firstOf(const NodeRun& run) const;
  /// The node's place, in words.
  std::string nameOf(uint64_t node) const;

 private:
  std::vector<BlockInfo> blocks_;
  std::vector<uint64_t> first_nodes_;  // [block]
};

/// Immutable: any number of threads.
class ConversionOrder {
 public:
  /// `cache` must outlive it. Reads the geometry of leaves that share a cell, since only their nodes tell
  /// them apart.
  explicit ConversionOrder(const CacheReader& cache);

  size_t size() const { return order_.size(); }
  /// [position in the order]: the brick in the order of bricks.bin.
  uint32_t operator[](size_t position) const { return order_[position]; }
  /// The other way round.
  uint32_t positionOf(uint32_t brick) const { return positions_[brick]; }

  /// The leaf brick that holds the splat of `node` at `position`; kNoBrick if there is no cell for it.
  uint32_t leafOf(const RootPosition& position, uint64_t node) const;
  /// Whether the brick's cell is another brick's too, so that leafOf() depends on the node.
  bool sharesItsCell(uint32_t brick) const;

 private:
  void append(uint32_t brick);

  std::span<const Brick> bricks_;
  std::vector<uint32_t> order_, positions_;
  std::map<uint32_t, uint64_t> first_nodes_;  // of bricks that share their cell
};

}  // namespace curvisplat
