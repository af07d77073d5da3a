// A grid that runs around the Earth, without the gap or the overlap that a model leaves in it.
//
//   east and west   the last column is a step before the first: a copy of the first column is appended.
//                   The last columns repeat the first (NEMO's halo): they are left out, but for one.
//   north           tripolar grids fold their last row onto itself. A row that repeats the last but two
//                   (a fold through T points) is left out. A row that repeats the one before it, mirrored
//                   (a fold through F points), would have each of its cells twice: half of its nodes are
//                   blanked. Where that row is missing, it is appended.
//
// Coincident nodes at the ends become one splat, as for every periodic axis (splats/seams.h). Only for grids
// on a sphere whose first axis runs around it.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/grid/box_source.h"

namespace curvisplat {

/// How a grid closes. Columns and rows are those of the source.
struct GridClosure {
  enum class North { kOpen, kDropRow, kHalfRow, kAddRow };
  uint64_t columns = 0;       // kept, from the first
  bool repeat_first = false;  // after them
  North north = North::kOpen;
  uint64_t mirror =
      0;  // kHalfRow, kAddRow: node i of the mirrored row is node (mirror - i) of the row before
          // it, modulo the number of distinct columns
};

/// The points [begin, end) of row j on the unit sphere, not finite where there is none.
using PointsOfRow = std::function<std::vector<glm::dvec3>(uint64_t j, uint64_t begin, uint64_t end)>;

/// Finds how a grid closes, from a few rows of a block of ni x nj columns; nullopt if the grid needs nothing.
/// Long rows are read in parts. Throws what `points` throws.
std::optional<GridClosure> closureOf(uint64_t ni, uint64_t nj, const PointsOfRow& points);

class ClosedGrid final : public ForwardingGrid {
 public:
  ClosedGrid(std::unique_ptr<GridSource> source, const GridClosure& closure);

  /// Whole rows are read to the arrays of `out`, without memory of its own.
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  void readParts(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                 NodeArrays& out) const;
  /// Columns [begin, end) of the source, which are the nodes from `to` on along i, or, backwards, those from `to` down.
  struct Columns {
    uint64_t begin = 0, end = 0, to = 0;
    bool backwards = false;
  };
  std::vector<Columns> columnsOf(uint64_t i0, uint64_t i1, bool mirrored) const;
  template <typename Value>
  void rearrange(const NodeBox& box, uint64_t rows_read, std::vector<Value>& values) const;
  void blankHalfRow(const NodeBox& box, NodeArrays& out) const;

  GridClosure closure_;
  uint64_t ni_ = 0, nj_ = 0;  // of the source
};

}  // namespace curvisplat
