// Sample points of blocks, by which their overlaps are estimated: most of them close to the blocks' faces.
//
// Points are in the order of their blocks, cells (i fastest) and places in a cell. What is summed over them is summed in that
// order, so it depends neither on the slabs nor on how the points are divided.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/box_tree.h"

namespace curvisplat {

/// A sample point of a block, and the volume that it represents.
struct BlockPoint {
  glm::dvec3 position{0.0};
  double volume = 0;
  uint32_t block = 0;
};

/// The sample points along one axis of a block: several in the first and the last cell, close to the ends of the block, to
/// find overlaps of less than a cell; one at the centres of other cells, evenly spread.
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

  /// `wanted`: of the cells between the first and the last, at least one if there are any. `few`: fewer at the ends.
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
  /// Of a block that has cells, in a grid of `cells_in_all` cells and `blocks` blocks.
  BlockSampling(const GridBlock& block, double cells_in_all, size_t blocks);

  /// Those of cells with blanked corners included.
  uint64_t points() const { return i.points() * j.points() * k.points(); }
  uint64_t cellNumber(uint64_t at_i, uint64_t at_j, uint64_t at_k) const {
    return (at_k * nj_ + at_j) * ni_ + at_i;
  }
  uint64_t planeOf(uint64_t cell) const { return cell / (ni_ * nj_); }
  uint64_t endOfCells() const { return cellNumber(0, 0, k.cells()); }
  /// The points in cells before this one.
  uint64_t pointsBefore(uint64_t cell) const;
  /// The end of the cells from `begin` on that have `most` points at the most. `most` is as many as a cell has, or more.
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

/// Gathers the sample points of a part of a block from its slabs. For one thread; add() is a parallel loop.
class PointPicker {
 public:
  /// Appends the points to `points`, which nobody else changes meanwhile, with volume 0 until their cells are added.
  PointPicker(const GridBlock& block, const BlockSampling& sampling, const CellPart& part,
              std::vector<BlockPoint>& points);

  /// A slab of the block with kCornerHalo. In any order.
  void add(const LoadedSlab& loaded);
  /// After the last slab: adds the points' volumes to `volume`, and removes those in no cell and, with `others`, those in no
  /// other block's bounds.
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

}  // namespace curvisplat
