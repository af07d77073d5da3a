// Decides which block draws the data where several overlap: every point of space has one owner.
//
// The owner of a point is one of the blocks with a cell that holds it. Blocks whose node next to the point is
// no fringe (GridSource::readFringe) come before others; then the one with the smallest cell there
// (cell_tree.h) owns the point, and of those of one size the first. That depends on the grid alone. A
// sample's cell is looked at in 64 points (preprocess/shape/covered_part.h), but only where owners change:
// every sample is located once in each block that its own one overlaps, and where it and all of its
// neighbours lie inside, nothing more is asked.
//
//    slab of block A --samples--> CellTree of a part of block B --> covered points of A's samples
//                                 (tiles: the parts in memory)
//
// Only cells whose corners are all there count. Only pairs of blocks that findOverlaps() has found are
// compared, so that blocks that abut lose nothing to one another.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/overset/cell_tree.h"
#include "preprocess/overset/sample_cells.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// The blocks that draw the data where several overlap.
enum class Overlap {
  kOwner,  // the owner of each point alone
  kAll,    // every block
};

/// Finds the owners of samples. One thread calls; the functions are parallel loops.
class BlockOwners {
 public:
  /// Reads, once, each block that overlaps another. `reader` gives the samples that are there. Memory:
  /// `memory_bytes`, but at least for some rows. Throws Error if a file cannot be read.
  BlockOwners(NodeReader reader, const std::vector<BlockOverlap>& overlaps, uint64_t memory_bytes);

  /// Sets covered[n] for each sample of the slab's box, where n is its number in the slab's window: a bit for
  /// each of its 64 points that another block owns (preprocess/shape/covered_part.h). Empty if there are
  /// none. The window has a halo of at least a sample before and after (two for cells). Throws Error if a
  /// file cannot be read.
  void cover(const LoadedSlab& loaded, std::vector<uint64_t>& covered);

 private:
  static uint64_t leastBytes(const GridDescription& grid, size_t scalars);
  struct Tile {
    Slab slab;
    BoundingBox box;
    // Whether all of its nodes are fringe, and its smallest cell; known once its tree has been built.
    std::optional<std::pair<bool, CellSize>> first;
  };
  struct TreeOfTile {
    size_t tile;
    std::shared_ptr<const CellTree> tree;
  };
  class SlabCover;

  std::shared_ptr<const CellTree> treeOf(size_t tile);
  LoadedSlab read(const Slab& slab) const;
  std::vector<uint8_t> fringeOf(const Slab& slab) const;  // empty if the grid has none

  const NodeReader reader_;
  const uint64_t memory_bytes_;
  std::vector<std::vector<uint32_t>> partners_;  // [block]: those that it overlaps, rising
  std::vector<Tile> tiles_;
  std::vector<std::vector<size_t>> tiles_of_;  // [block]
  std::list<TreeOfTile> kept_;                 // the last used first
  uint64_t kept_bytes_ = 0;
};

/// The reader of what BlockOwners needs for the samples of `reader`. `everywhere`: they all have values where
/// the grid has nodes.
NodeReader ownersReader(const NodeReader& reader, bool everywhere);

}  // namespace curvisplat
