// Statistics of a grid, for `info` before conversion: ranges, blanking, and degenerate or inverted cells. The
// grid is read by slabs.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// The statistics of a block.
struct BlockStatistics {
  BlankCounts blank;        // of its nodes
  uint64_t cells = 0;       // cells without blanked corners
  uint64_t degenerate = 0;  // cells with a corner whose edges span no volume
  uint64_t inverted = 0;    // cells with a corner whose handedness is the minority in the block
  double volume = 0;        // sum over the trilinear hexahedra
};

/// The statistics of a structured grid.
struct GridStatistics {
  std::vector<BlockStatistics> blocks;
  std::array<ScalarRange, 3> bounds;    // of the nodes that are not blanked, along x, y, z
  std::vector<ScalarRange> scalars;     // [requested scalar]; of the samples that are not blanked
  std::vector<uint64_t> missing;        // [requested scalar]: nodes without a value, where another has one
  uint64_t cell_values_not_finite = 0;  // cells with an infinite value of a cell-centred scalar

  BlankCounts blank() const;
  uint64_t cells() const;
  uint64_t degenerate() const;
  uint64_t inverted() const;
};

/// Measures the given scalars of the source, node-centred and cell-centred, each by itself. A sample is blanked if none of
/// the scalars with its centring has a value. Memory: two slabs. Throws Error if the grid cannot be read.
GridStatistics measureGrid(const GridSource& source, const std::vector<uint32_t>& scalars,
                           uint64_t slab_bytes, Progress& progress);

}  // namespace curvisplat
