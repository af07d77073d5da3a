// What is in a grid, before anything is converted: ranges, blanking, and cells that are odd. Read by slabs.
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

struct BlockStatistics {
  BlankCounts blank;        // of its nodes
  uint64_t cells = 0;       // all of whose corners are there
  uint64_t degenerate = 0;  // of those: the edges at one of the corners span no volume
  uint64_t inverted = 0;    // cells with a corner of the other hand than most of the block's
  double volume = 0;        // of the hexahedra
};

struct GridStatistics {
  std::vector<BlockStatistics> blocks;
  std::array<ScalarRange, 3> bounds;  // of the nodes that are there, along x, y, z
  std::vector<ScalarRange> scalars;   // [as asked for]; of the nodes or cells that are there

  BlankCounts blank() const;
  uint64_t cells() const;
  uint64_t degenerate() const;
  uint64_t inverted() const;
};

/// Of these scalars of the source, at nodes and in cells. A node is there if it is for all of the scalars
/// that stand at nodes. Memory: two slabs. Throws Error if the grid cannot be read.
GridStatistics measureGrid(const GridSource& source, const std::vector<uint32_t>& scalars,
                           uint64_t slab_bytes, Progress& progress);

}  // namespace curvisplat
