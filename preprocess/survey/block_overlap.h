// Finds blocks that overlap without blanking (overset grids without iblank), where every block that is drawn would
// count the data once more. Who draws it is decided in preprocess/overset.
//
// Sample points of every block, most of them close to its faces, are located in the cells of all other
// blocks. Abutting blocks share no volume, whether or not their nodes match on the common face; overlaps of
// up to a five-hundredth of a block, where two blocks approximate a curved face by different chords, are
// ignored. There are about 100,000 points, and some more at each block's corners, edges and faces. Where all of them fit
// in memory, the coordinates are read twice, or once if the blocks' bounding boxes are disjoint. Otherwise the first pass
// finds the boxes alone, and the points of blocks whose boxes touch are picked and located in parts:
//
//    blocks --boxes--> BoxTree --PointPicker--> points in others' boxes --PointHolders--> shared volumes of pairs
//                                 as many as fit, and again
//
// Time: n log n in the blocks, and for each cell what finding the points near it takes, however long and
// slanted it is; a point is located in at most 16 other blocks. Grids of more than 100,000 blocks are not checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// A pair of blocks that overlap, and by how much.
struct BlockOverlap {
  uint32_t first = 0, second = 0;  // blocks, first < second
  double volume = 0;               // of the intersection, estimated
  double share = 0;                // volume / volume of the smaller block
};

/// The memory that the search may take, beside some hundred bytes a block.
struct OverlapMemory {
  uint64_t slab_bytes = 0;   // each of two
  uint64_t point_bytes = 0;  // the points that are located at a time, and pairs of blocks
  /// The limit of memory to name where `point_bytes` should be this; null: there is no limit for pairs.
  uint64_t (*cap_for)(uint64_t point_bytes) = nullptr;
};

/// All pairs of blocks with more than a negligible overlap, in order of their numbers. The result depends
/// neither on the number of threads nor on the memory. `met_in_vain`: unless null, how often points were near a cell and had not
/// to be located in it, which is most of the work where cells pass through one another; depends on the threads. Throws Error
/// if the grid cannot be read, or the pairs do not fit.
std::vector<BlockOverlap> findOverlaps(const GridSource& source, const OverlapMemory& memory,
                                       const Progress& progress, uint64_t* met_in_vain = nullptr);

/// One line that says that there are too many blocks to search for overlaps; else empty.
std::string unsearchedOverlaps(const GridDescription& description);
/// One line, with the largest overlaps by name and the total volume: that all blocks are drawn there, or each point
/// once. Empty if there are no overlaps.
std::string overlapWarning(const GridDescription& description, const std::vector<BlockOverlap>& overlaps);
std::string overlapNote(const GridDescription& description, const std::vector<BlockOverlap>& overlaps);

}  // namespace curvisplat
