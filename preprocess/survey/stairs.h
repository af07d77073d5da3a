// Blanked nodes of a block may leave stairs, as an ocean's floor does. Splats reach around their edges.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Returns for each block which share of its drawn inner nodes lies at stairs: 0 where another block may be drawn in place of the
/// blanked nodes, and where a scalar cannot be read. Nodes are blanked by the grid, and where none of `scalars` has a value other than
/// `blank_value`; scalars of cells do not count, and of others the first 16.
std::vector<double> shareAtStairs(const GridSource& source, const std::vector<uint32_t>& scalars,
                                  std::optional<double> blank_value);

}  // namespace curvisplat
