// Builds the bricks of one cell of the octree, with all that lies below it, from records in memory: leaf
// bricks first, then their parents up to the cell itself, in parallel.
//
// What comes out depends on the splats alone: not on the order of the records, not on threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"

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

class CellBuilder {
 public:
  /// `blocks`, `progress`, which can stop it, and `histograms`, which leaves are added to, must outlive it.
  /// `precision`: of the leaves' values.
  CellBuilder(const RootCube& root, const std::vector<GridBlock>& blocks, size_t variables,
              HistogramSums& histograms, const Progress& progress, ValuePrecision precision);
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

}  // namespace curvisplat
