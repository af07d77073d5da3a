// Blocks that lie in one another without saying so (overset grids without iblank): there everything is drawn
// twice. Found before conversion, and told.
//
// Points of every block, most of them close to its faces, are looked for in the cells of all others. Blocks
// that abut have none there, with the same nodes on their common face or with others; what they lap over one
// another by cutting a curved face into other chords is negligible (a five-hundredth of a block). The grid's
// coordinates are read twice, once where the blocks' boxes lie apart. Memory: two slabs, and a hundred bytes
// a point: some 100 thousand points, and in each block's corners, edges and faces a few more. Time: n log n of
// the blocks, and that of the points in each cell's surroundings; a point is looked for until 16 other blocks
// hold it. Grids of more than 20,000 blocks are not looked at.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

struct BlockOverlap {
  uint32_t first = 0, second = 0;  // blocks, first < second
  double volume = 0;               // in both, estimated
  double share = 0;                // of the smaller block's volume
};

/// All pairs whose overlap is not negligible, by the blocks' numbers. The same for any number of threads and
/// slabs of any size. Throws Error if the grid cannot be read.
std::vector<BlockOverlap> findOverlaps(const GridSource& source, uint64_t slab_bytes,
                                       const Progress& progress);

/// In words, one line for the file: the largest few by name, and the volume of all; or that there are too
/// many blocks to look. Empty if there are none.
std::string overlapWarning(const GridDescription& description, const std::vector<BlockOverlap>& overlaps);

}  // namespace curvisplat
