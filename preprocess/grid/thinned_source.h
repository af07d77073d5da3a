// Every n-th index plane of a grid: a coarse grid of the same shape, for a first picture of a large one.
#pragma once

#include <cstdint>
#include <memory>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The smallest n for which every n-th index plane of each direction, and the last ones, have at most `nodes` nodes
/// together; 1 if all of the grid has no more. Blocks keep two planes in each direction, so that many small blocks can
/// have more.
uint64_t strideFor(const GridDescription& grid, uint64_t nodes);

/// The index planes 0, n, 2n, ... of `source`, and the last ones, so that the outer faces stay where they are. Values at
/// nodes are the grid's own; a cell has the value of the lowest of the cells that it replaces. Rows are read one by one:
/// of a file, about 1/n² of its bytes. Boundaries and flow conditions are left out of the description. `source` must
/// outlive it. Any number of threads may read concurrently.
std::unique_ptr<GridSource> thinned(const GridSource& source, uint64_t stride);

}  // namespace curvisplat
