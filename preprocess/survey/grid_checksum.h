// Tells whether two time steps have the same geometry: a checksum of all that it depends on, the coordinates of
// the nodes and what is blanked, byte for byte. The sum of the rows' checksums, so that it does not depend on how
// the grid is divided.
#pragma once

#include <cstdint>

#include "preprocess/grid/slabs.h"

namespace curvisplat {

/// Of the rows of the slab's box, without its halo: the sum over all slabs of a grid is the grid's. Parallel.
uint64_t checksumOfGrid(const LoadedSlab& loaded, const GridBlock& block);

}  // namespace curvisplat
