// A part of a grid, for finding out what conversion of the whole will take: some boxes of rows, spread over the blocks, each a
// block of its own.
#pragma once

#include <cstdint>
#include <memory>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Boxes of `source` with about `nodes` nodes together, rows whole; all of its blocks, each as it is, if it has no more
/// nodes than that. Boxes do not overlap. Boundaries and flow conditions are left out of the description.
std::unique_ptr<GridSource> sampleOf(std::shared_ptr<const GridSource> source, uint64_t nodes);

}  // namespace curvisplat
