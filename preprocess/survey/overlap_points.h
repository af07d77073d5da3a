// Sample points of blocks, by which the blocks' overlaps are estimated (block_overlap.h): most of them lie
// close to the blocks' faces. PointPicker picks them from a block's cells, slab by slab; PointHolders finds
// which of them lie in other blocks, as the cells of these come slab by slab.
//
// Points are in the order of their blocks, cells (i fastest) and places in a cell. What is summed over them
// is summed in that order, so it depends neither on the slabs nor on how the points are divided. One thread
// calls; what is done with a slab is a parallel loop over its rows.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/bounding_tree.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// A sample point of a block, and the volume that it represents.
struct BlockPoint {
  glm::dvec3 position{0.0};
  double volume = 0;
  uint32_t block = 0;
};

/// The sample points along one axis of a block: several in the first and the last cell, close to the ends of
/// the block, to find overlaps of less than a cell; one at the centres of other cells, evenly spread.
class AxisSampling {
 public:
  /// A place in a cell (0 to 1), and the number of cells it represents.
  struct Point {
    double t, cells;
  };
  struct Cell {
    std::span<const Point> points;  // of the cell; mostly none
    uint64_t before = 0;            // points in the cells before it
  };

  /// `wanted`: of the cells between the first and the last, at least one if there are any. `few`: fewer at
  /// the ends.
  AxisSampling(uint64_t cells, uint64_t wanted, bool few);

  Cell at(uint64_t cell) const;
  uint64_t cells() const { return cells_; }
  uint64_t points() const { return first_.size() + count_ + last_.size(); }

 private:
  uint64_t cells_, inner_ = 0, count_ = 0;  // cells; those between the first and the last; points of these
  std::vector<Point> first_, last_;
  Point middle_{0.5, 0};
};

/// The sample points of a block, as a product of those along i, j and k. Any thread.
class BlockSampling {
 public:
  /// Samples a block that has cells, in a grid of `cells_in_all` cells and `blocks` blocks.
  BlockSampling(const GridBlock& block, double cells_in_all, size_t blocks);

  /// The number of points, with those of cells with blanked corners.
  uint64_t points() const { return i.points() * j.points() * k.points(); }
  uint64_t cellNumber(uint64_t at_i, uint64_t at_j, uint64_t at_k) const {
    return (at_k * nj_ + at_j) * ni_ + at_i;
  }
  uint64_t planeOf(uint64_t cell) const { return cell / (ni_ * nj_); }
  uint64_t endOfCells() const { return cellNumber(0, 0, k.cells()); }
  /// The points in cells before this one.
  uint64_t pointsBefore(uint64_t cell) const;
  /// The end of the cells from `begin` on that have `most` points at the most. `most` is as many as a cell
  /// has, or more.
  uint64_t endOfPart(uint64_t begin, uint64_t most) const;
  static constexpr uint64_t kMaxPointsOfCell = 6 * 6 * 6;

 private:
  uint64_t ni_, nj_;  // nodes

 public:
  const AxisSampling i, j, k;
};

/// A range of the cells of a block, by number.
struct CellPart {
  uint32_t block = 0;
  uint64_t begin = 0, end = 0;
};

/// Gathers the sample points of a part of a block from its slabs.
class PointPicker {
 public:
  /// Appends the points to `points`, which nobody else changes meanwhile, with volume 0 until their cells
  /// are added.
  PointPicker(const GridBlock& block, const BlockSampling& sampling, const CellPart& part,
              std::vector<BlockPoint>& points);

  /// A slab of the block with kCornerHalo. In any order.
  void add(const LoadedSlab& loaded);
  /// Ends the block after its last slab: adds the points' volumes to `volume`, and removes those in no cell
  /// and, with `others`, those in no other block's bounds.
  void finish(double& volume, const BoxTree* others);

 private:
  const GridBlock& block_;
  const BlockSampling& sampling_;
  const CellPart part_;
  std::vector<BlockPoint>& points_;
  const size_t first_;      // of points_
  const uint64_t skipped_;  // points of the block before those of the part
};

/// Removes the points, from number `first` on, that lie in no bounds but their own block's.
void keepPointsInOthers(std::vector<BlockPoint>& points, size_t first, const BoxTree& boxes);

/// Some points, given by number, sorted into the cells of a uniform lattice. Any thread may ask.
class PointBins {
 public:
  PointBins(std::span<const BlockPoint> points, const std::vector<uint32_t>& numbers);

  /// Calls each(number) for the points of the bins that the box touches. False, and calls nothing, if there
  /// are many bins or points.
  template <typename Each>
  bool forEachOfFew(const BoundingBox& box, const Each& each) const;

 private:
  static constexpr uint64_t kAlongAxis = 64;
  std::array<uint64_t, 3> place(const glm::dvec3& position) const;
  uint64_t binOf(const glm::dvec3& position) const;

  BoundingBox box_;
  glm::dvec3 scale_{0.0};
  std::vector<uint32_t> first_, sorted_;
};

/// Finds which blocks hold which of the sample points, as the blocks' cells come one after another.
///
/// A point that lies in kMaxHolders blocks is located no further: otherwise a set that names one file a
/// thousand times would take the square of that. Where cells pass through one another, such as those of
/// random coordinates, each of them meets a share of all points, nearly all of which are the block's own or
/// were found in its first cells: those are sorted out on the way, and come back for the next block.
class PointHolders {
 public:
  /// Borrows the points, of one block after another.
  explicit PointHolders(std::span<const BlockPoint> points);

  bool areAllFound() const { return !is_pruned_ && tree_.size() == 0; }
  /// Whether points of another block lie in the box of this one.
  bool mayHold(uint32_t block, const BoundingBox& box) const;
  /// Locates the points in the cells of a slab with kCornerHalo. Throws Interrupted if a stop is asked for.
  void locate(const GridBlock& block, const LoadedSlab& loaded, const Progress& progress);
  /// To be called after the last slab of each block: the points that lie in it and not in kMaxHolders blocks
  /// before it, rising. Valid until the next call.
  std::span<const uint32_t> finishBlock();
  /// How often cells met points that were not to be located in them, in the blocks that are finished.
  uint64_t metInVain() const { return met_in_vain_; }

  static constexpr uint8_t kMaxHolders = 16;
  /// Bytes of each point, beside the point.
  static constexpr uint64_t kBytesEach = 160;

 private:
  void locateInCell(uint32_t block, const std::array<glm::dvec3, 8>& corner, std::vector<uint32_t>& found);
  bool isWanted(uint32_t point, uint32_t block) const;
  bool shouldPrune() const;
  void prune(uint32_t block);
  void sort(const std::vector<uint32_t>& wanted);

  const std::span<const BlockPoint> points_;
  std::vector<uint8_t> counts_;  // [point]
  std::vector<std::atomic<uint32_t>>
      latest_;                      // [point]: 1 + the latest block that is known to contain it; 0: none
  PointBins bins_;                  // the points still to be located, and few others
  PointTree tree_;                  // the same: for cells in whose bins many lie
  size_t finished_ = 0;             // of the points in tree_
  bool is_pruned_ = false;          // tree_ lacks points that blocks to come are searched for
  std::atomic<size_t> in_vain_{0};  // how often cells met points that are not wanted, since tree_ was built
  uint64_t met_in_vain_ = 0;        // before that
  std::vector<uint32_t> inside_, given_;  // of the block; those that finishBlock() has returned
};

template <typename Each>
bool PointBins::forEachOfFew(const BoundingBox& box, const Each& each) const {
  constexpr uint64_t kFewBins = 64, kFewPoints = 64;
  if (!box_.touches(box)) return true;
  const auto low = place(box.lower), high = place(box.upper);
  if ((high[0] - low[0] + 1) * (high[1] - low[1] + 1) * (high[2] - low[2] + 1) > kFewBins) return false;
  const auto for_each_row = [&](const auto& visit) {
    for (uint64_t z = low[2]; z <= high[2]; ++z)
      for (uint64_t y = low[1]; y <= high[1]; ++y) {
        const uint64_t row = (z * kAlongAxis + y) * kAlongAxis;
        visit(first_[row + low[0]], first_[row + high[0] + 1]);
      }
  };
  uint64_t count = 0;
  for_each_row([&](uint32_t begin, uint32_t end) { count += end - begin; });
  if (count > kFewPoints) return false;
  if (count == 0) return true;
  for_each_row([&](uint32_t begin, uint32_t end) {
    for (uint32_t n = begin; n < end; ++n) each(sorted_[n]);
  });
  return true;
}

}  // namespace curvisplat
