// Cuts the blocks of a grid into slabs that fit a given number of bytes, and reads one slab ahead of the
// processing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/read_ahead.h"

namespace curvisplat {

/// Additional rows and planes on either side of a box, within the block.
struct Halo {
  uint64_t before = 0, after = 0;
};

/// The nodes of a cell and of its neighbours.
inline constexpr Halo kCellHalo{1, 2};
inline constexpr Halo kCornerHalo{0, 1};  // the corners of the cells whose lowest nodes are in a box
inline constexpr Halo kNoHalo{0, 0};
inline constexpr Halo kNodeHalo{1, 1};  // a node's neighbours

/// A box of one block. `window` is `box` with its halo.
struct Slab {
  uint32_t block = 0;
  uint64_t first_node = 0;  // number of the block's first node in the whole grid
  NodeBox box, window;
};

inline uint64_t rowsOf(const NodeBox& box) {
  return (box.j1 - box.j0) * (box.k1 - box.k0);
}

/// The strides of a window of a block in NodeArrays: node i, j, k of the block is element at(i, j, k).
struct WindowStrides {
  uint64_t i0, j0, k0;
  size_t row, plane;  // from one row to the next, and from one plane to the next

  WindowStrides(const NodeBox& window, uint64_t ni)
      : i0(window.i0),
        j0(window.j0),
        k0(window.k0),
        row(window.rowNodes(ni)),
        plane(row * (window.j1 - window.j0)) {}
  size_t at(uint64_t i, uint64_t j, uint64_t k) const { return (k - k0) * plane + (j - j0) * row + (i - i0); }
};

/// Size of a node in NodeArrays.
inline uint64_t slabBytesPerNode(size_t scalars) {
  return 3 * sizeof(double) + sizeof(uint8_t) + scalars * sizeof(float);
}

/// Cuts all blocks, in order, into boxes that cover each node once and whose windows have at most
/// `window_nodes` nodes: whole planes if several fit, else strips of about equal length along j and k, so
/// that few nodes are read twice. Where a row and its neighbours do not fit, rows are cut as well: with a halo into boxes
/// about as long along i, j and k, or longer along i where the block is thin; without one into parts of a single row.
/// The parts of a row follow one another. Throws Error if not even a node and its neighbours fit.
std::vector<Slab> cutIntoSlabs(const std::vector<GridBlock>& blocks, uint64_t window_nodes, Halo halo);

/// Size of the smallest window of whole rows: a row and its neighbours.
uint64_t leastSlabBytes(const std::vector<GridBlock>& blocks, size_t scalars, Halo halo);

/// Cuts `box` into boxes of about `nodes` nodes, one for each task. `row_nodes`: of a row of the box.
std::vector<NodeBox> cutForTasks(uint64_t row_nodes, const NodeBox& box, uint64_t nodes);

/// A slab and the nodes of its window.
struct LoadedSlab {
  Slab slab;
  NodeArrays nodes;
  BlankCounts blanked;
};

/// One of `count` shares of the slabs of a grid: consecutive slabs, about as many in each share.
struct SlabShare {
  unsigned index = 0, count = 1;
  bool whole_rows = false;  // all parts of a row are in one share
};

/// How large slabs are, and how many threads read them. In memory is one slab more than there are threads.
struct SlabBuffers {
  SlabBuffers(uint64_t bytes, unsigned reading_threads = 1)
      : slab_bytes(bytes), readers(reading_threads) {}  // implicit

  uint64_t slab_bytes;
  unsigned readers;
};

/// Reads all slabs of a grid, or a share of them, ahead of the caller, who gets them in order. `reader` must
/// outlive it.
class SlabStream {
 public:
  SlabStream(const NodeReader& reader, const SlabBuffers& buffers, Halo halo, const SlabShare& share = {});
  /// Some slabs of cutIntoSlabs().
  SlabStream(const NodeReader& reader, const SlabBuffers& buffers, std::vector<Slab> slabs);

  /// The next slab, valid until the next call; null at the end. Throws Error if a slab cannot be read.
  const LoadedSlab* next();

 private:
  /// Slabs that are read at a time: one, or several small ones, since handing one from thread to thread takes longer than
  /// reading a block of some hundred nodes.
  struct Group {
    std::vector<LoadedSlab> slabs;
    size_t count = 0;
  };
  static std::vector<size_t> endsOfGroups(std::span<const Slab> slabs, std::span<const GridBlock> blocks);

  const std::vector<Slab> slabs_;
  const std::vector<size_t> ends_;  // [group], of slabs_
  ReadAhead<Group> ahead_;
  const Group* group_ = nullptr;  // of the latest slab
  size_t next_ = 0;               // of its slabs
};

}  // namespace curvisplat
