// The blocks of a grid in another order: of a time step whose file lists the zones of the steps before it in an order of its own.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// [n]: which of `blocks` has the name `names[n]`; empty if the order is the same already, and where names do not tell: they differ, or one
/// occurs twice.
std::vector<uint32_t> orderByName(const std::vector<GridBlock>& blocks,
                                  const std::vector<std::string>& names);

/// Block n of the result is block `order[n]` of `source`, which must outlive it. Any number of threads may read concurrently.
std::unique_ptr<GridSource> reordered(const GridSource& source, std::vector<uint32_t> order);

}  // namespace curvisplat
