// Builds bricks: those of one cell of the octree with all that lies below it, from records in memory
// (CellBuilder: leaf bricks first, then their parents up to the cell itself, in parallel), and that of a
// cell from the bricks of its children (buildFromChildren()). Both merge children with OctantMerger.
//
// The bricks depend on the splats alone: not on the order of the records, not on threads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/shape/merge.h"
#include "stream/base/progress.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

struct BuiltBrick {
  EncodedBrick encoded;
  float error = 0;  // Brick::error
  bool is_leaf = true;
};

/// The bricks of a cell and of all cells below it, children before their parent. The cell's own come last.
struct BuiltCell {
  std::vector<BuiltBrick> bricks;
  size_t own_bricks = 0;
  double error = 0;
};

/// Records in memory: each begins its place in `places` after `base`, in bytes.
struct RecordSpan {
  const std::byte* base = nullptr;
  std::span<uint32_t> places;

  const std::byte* operator[](size_t n) const { return base + places[n]; }
  size_t size() const { return places.size(); }
  /// To be called for each record before its turn: neighbours in this order lie far apart in memory.
  void prefetchAfter(size_t n) const {
    constexpr size_t kAhead = 16;
    if (n + kAhead >= size()) return;
    const std::byte* record = base + places[n + kAhead];
    __builtin_prefetch(record);
    __builtin_prefetch(record + 63);  // most lie in two cache lines
  }
  RecordSpan subspan(size_t begin, size_t count) const { return {base, places.subspan(begin, count)}; }
};

/// Sorts records by node.
void sortByNode(RecordSpan records);

/// Builds cells from their records.
class CellBuilder {
 public:
  /// `blocks`, `progress`, which can stop it, and `histograms`, which leaves are added to, must outlive it.
  /// `codings`: [variable].
  CellBuilder(const RootCube& root, const std::vector<GridBlock>& blocks, size_t variables,
              HistogramSums& histograms, const Progress& progress, std::vector<ValueCoding> codings);
  ~CellBuilder();

  /// Builds `cell` from its records (one at least), whose places it reorders. A cell is a leaf if it has at
  /// most kMaxBrickSplats; a cell of more that cannot be divided (level kMaxLevel, or all its splats
  /// coincide) is a leaf of several bricks. Throws nothing but bad_alloc and Interrupted. Any
  /// thread.
  BuiltCell build(const Cell& cell, RecordSpan records);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Voxels along an edge of an inner brick's cell, as a power of two.
inline constexpr int kLatticeBits = 5;

/// The splats of a cell, merged into its octant of its parent's lattice. An inner brick is the eight
/// octants of its cell side by side, so that children can be merged one by one, as soon as each is done.
/// Within an octant voxels go in lattice order, x fastest: neighbours predict one another, and geometry.bin
/// as a whole takes up to 17 % less than with Morton order.
struct MergedOctant {
  BrickSplats splats;  // at most one a voxel, voxels in lattice order (x fastest); .cell is the child
  double detail = 0;   // world units: the largest of its voxels, SplatMerger::detail()
};

/// Merges one child at a time. For one thread; keeps its voxels' memory.
class OctantMerger {
 public:
  /// `even`: merged splats have an even blur and end at faces, as in caches with kMergedBorders.
  OctantMerger(const RootCube& root, size_t variables, bool even = true);

  /// Starts `child` (not the root), whose bricks follow.
  void begin(const Cell& child);
  /// Adds the decoded splats of one of its bricks. Sums follow the order of the calls and of the splats.
  void add(const BrickSplats& brick);
  MergedOctant finish();
  /// The values of the splats that finish() gives: [variable][splat].
  std::vector<std::vector<SplatScalar>> finishValues();

 private:
  size_t voxelOf(const RootPosition& position) const;
  RootPosition voxelCorner(size_t voxel) const;

  const RootCube root_;
  const size_t variables_;
  const bool even_;
  const double unit_;  // world units of a step of RootPosition
  VoxelMerger voxels_;
  Cell child_;
  int shift_ = 0;  // of a position, to its voxel
  std::vector<SplatScalar> values_;
};

/// The brick of the parent of the octants' cells.
BrickSplats joinOctants(const Cell& cell, size_t variables, std::array<MergedOctant, 8>&& octants);

/// The bricks of one octant of a cell; none: it is empty.
struct ChildBricks {
  Cell cell;
  uint64_t bricks = 0;
  double error = 0;                             // the largest of theirs
  std::function<BrickSplats(uint64_t n)> read;  // the n-th, decoded; any thread
};

/// The codings of inner bricks, whose values are means of many: fine ones are for leaves alone.
std::vector<ValueCoding> codingsOfMerged(std::vector<ValueCoding> codings);

/// The brick of a cell, merged from the bricks of its children, in parallel. `codings`: [variable], of leaves. Throws what
/// reading throws.
BuiltCell buildFromChildren(const RootCube& root, const std::vector<ValueCoding>& codings, const Cell& cell,
                            const std::array<ChildBricks, 8>& children);

}  // namespace curvisplat
