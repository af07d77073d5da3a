// The first pass over a grid: number, bounds and ranges of its samples (GridSurvey), with what is taken
// from the slabs on the way: a checksum that tells whether two time steps have the same geometry, and a
// sample of the positions. surveyCells() is the pass for cell-centred scalars; for node-centred ones it is
// surveyGrid() (preprocess/convert/scan.h).
//
// No result depends on threads or on how the grid is cut into slabs. One thread calls; passes and
// GridChecksum::add() are parallel loops.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/checksum.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// The range of a scalar; empty (min > max) if there are no values.
struct ScalarRange {
  double min = std::numeric_limits<double>::infinity();
  double max = -std::numeric_limits<double>::infinity();
};

/// Counts and ranges of the nodes, or for cell-centred scalars of the cells (bounds: of their corners).
struct GridSurvey {
  uint64_t nodes = 0;  // samples (nodes or cells) of the grid, including blanked ones
  BlankCounts blanked;
  glm::dvec3 lower{std::numeric_limits<double>::infinity()};
  glm::dvec3 upper{-std::numeric_limits<double>::infinity()};
  std::vector<ScalarRange> ranges;  // [scalar]; of the samples that are not blanked
  uint64_t grid_checksum = 0;       // GridChecksum's
};

/// Sentences on those of these scalars that single precision cannot show: no value but 0 is large enough for it, or they differ by so
/// little that it loses them; and on derived ones that need an absolute pressure where it is negative. Reads some of the values
/// again. `ranges`: [scalar].
std::vector<std::string> warningsOfRanges(const DataSource& source, std::span<const uint32_t> scalars,
                                          std::span<const ScalarRange> ranges);

/// The survey of the samples of both, which have the same scalars and no sample in common.
GridSurvey unitedSurvey(GridSurvey a, const GridSurvey& b);

/// Every n-th of a grid's positions, taken while the grid is read for another reason: enough to plan
/// buckets by, so that the coordinates need not be read once more for counting them.
class PositionSample {
 public:
  /// Samples a grid of `nodes` nodes, of which it takes `most` at most.
  PositionSample(uint64_t nodes, uint64_t most);

  /// How many nodes each of the positions stands for.
  uint32_t nodesEach() const { return nodes_each_; }
  /// Adds those of a slab's box that are there. Which ones they are does not depend on how the grid is cut
  /// into slabs.
  void add(const LoadedSlab& loaded, const GridBlock& block);
  std::span<const glm::dvec3> positions() const { return positions_; }

  /// Bytes of memory a position takes.
  static constexpr uint64_t kBytesEach = sizeof(glm::dvec3);

 private:
  uint32_t nodes_each_;
  std::vector<glm::dvec3> positions_;
};

/// Tells whether two time steps have the same geometry: a checksum of all that the geometry depends on, the
/// coordinates of the nodes and the blanking, byte for byte. It is the sum of the rows' checksums, so that
/// it does not depend on how the grid is divided. While rows are cut it keeps 2.3 KiB for each row of a
/// slab.
class GridChecksum {
 public:
  /// Adds the rows of the slab's box, without its halo; works in parallel. The parts of a row must come one
  /// after the other, as cutIntoSlabs() lists them.
  void add(const LoadedSlab& loaded, const GridBlock& block);

  /// The checksum of the rows that were added. The sum of the values of all shares of a grid is the grid's
  /// checksum.
  uint64_t value() const { return sum_; }

 private:
  /// A row of which the first parts were added.
  struct Row {
    Checksum x, y, z, blank;
  };
  uint64_t ofParts(Row& row, const LoadedSlab& loaded, const GridBlock& block, uint64_t j, uint64_t k) const;

  uint64_t sum_ = 0;
  std::vector<Row> rows_;  // of the last slab's box, if that has parts of rows
};

/// Objects that a survey fills beside its result; a null one is not filled.
struct SurveyExtras {
  AbuttingFaces* faces = nullptr;  // of cells
  PositionSample* sample = nullptr;
};

/// The first pass for a reader of cell-centred scalars. Counts, bounds (of the
/// corners) and ranges refer to cells. A cell with a blanked corner or without a value counts as blanked by
/// the grid. The extra faces are those of all other cells at the ends of their blocks.
GridSurvey surveyCells(const NodeReader& reader, uint64_t slab_bytes, const SurveyExtras& extras,
                       Progress& progress);

}  // namespace curvisplat
