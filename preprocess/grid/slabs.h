// Cuts the blocks of a grid into slabs that fit a given number of bytes, and reads them one ahead of the
// work.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/read_ahead.h"

namespace curvisplat {

/// Rows and planes that are read on either side of a box, where the block goes on.
struct Halo {
  uint64_t before = 0, after = 0;
};

/// A cell's own nodes, and those of its neighbours.
inline constexpr Halo kCellHalo{1, 2};
inline constexpr Halo kNoHalo{0, 0};
inline constexpr Halo kNodeHalo{1, 1};  // a node's neighbours

/// Some rows of one block. `window` is `box` and its halo.
struct Slab {
  uint32_t block = 0;
  uint64_t first_node = 0;  // of the block, in the whole grid
  NodeBox box, window;
};

inline uint64_t rowsOf(const NodeBox& box) {
  return (box.j1 - box.j0) * (box.k1 - box.k0);
}

/// Bytes that a node takes in NodeArrays.
inline uint64_t slabBytesPerNode(size_t scalars) {
  return 3 * sizeof(double) + sizeof(uint8_t) + scalars * sizeof(float);
}

/// Cuts all blocks, in order, into boxes that cover each node once and whose windows have at most
/// `window_nodes` nodes: whole planes where a few of them fit, else strips of rows that are as long in k as
/// in j, so that little is read twice. Throws Error if a row and its neighbours do not fit.
std::vector<Slab> cutIntoSlabs(const std::vector<GridBlock>& blocks, uint64_t window_nodes, Halo halo);

/// Cuts `box` into boxes of about `nodes` nodes: the work of one task.
std::vector<NodeBox> cutForTasks(const GridBlock& block, const NodeBox& box, uint64_t nodes);

/// A slab and what was read of its window.
struct LoadedSlab {
  Slab slab;
  NodeArrays nodes;
  BlankCounts blanked;
};

/// Reads all slabs of a grid, in order, one ahead. `reader` must outlive it. Two slabs of `slab_bytes` are in
/// memory.
class SlabStream {
 public:
  SlabStream(const NodeReader& reader, uint64_t slab_bytes, Halo halo);

  /// The next slab, until the next call; null at the end. Throws Error if a slab cannot be read.
  const LoadedSlab* next() { return ahead_.next(); }

 private:
  std::vector<Slab> slabs_;
  size_t position_ = 0;
  ReadAhead<LoadedSlab> ahead_;
};

}  // namespace curvisplat
