// Writes a grid of any size as PLOT3D: PREFIX.xyz (coordinates), PREFIX.fun (a function file of the scalars)
// and PREFIX.nam (their names, one a line).
//
//   PREFIX.xyz   [blocks]  {ni nj nk} a block          {x of all nodes, y, z, [iblank]} a block
//   PREFIX.fun   [blocks]  {ni nj nk scalars} a block  {scalar 1 of all nodes, scalar 2, ...} a block
//
// Little-endian, without record markers ("C binary"), 32-bit integers and single precision; the block count
// only if there are several blocks, iblank only if a block has blanking. i fastest, then j, then k.
#pragma once

#include <filesystem>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Writes all blocks and all scalars of `source`, and returns the paths of what it wrote. The source is read
/// by TBB workers, the caller's thread writes; memory is about 100 MB (and some rows), whatever the grid.
///
/// The files take their names when all are whole; a failure leaves what was there before. Throws Error: a
/// block with a dimension over 2^31 - 1, too little free space, or a disk that fails.
std::vector<std::filesystem::path> writePlot3d(const GridSource& source, const std::filesystem::path& prefix,
                                               Progress& progress);

}  // namespace curvisplat
