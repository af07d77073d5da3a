// Levels of detail: what a cell holds, merged into its octant of its parent's lattice. An inner brick is the
// eight octants of its cell side by side, so that children can be merged one by one, as soon as each is done.
// Within an octant voxels go in lattice order, x fastest: neighbours predict one another, and geometry.bin as
// a whole takes up to 17 % less than with Morton order.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "preprocess/splats/merge.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// Voxels along an edge of an inner brick's cell, as a power of two.
inline constexpr int kLatticeBits = 5;

struct MergedOctant {
  BrickSplats splats;  // at most one a voxel, voxels in lattice order (x fastest); .cell is the child
  double detail = 0;   // world units: the largest of its voxels, SplatMerger::detail()
};

/// Merges one child at a time. For one thread; keeps its voxels' memory.
class OctantMerger {
 public:
  /// `even`: merged splats have an even blur and end at faces, as in caches with kMergedBorders.
  OctantMerger(const RootCube& root, size_t variables, bool even = true);

  /// Starts `child` (not the root), whose bricks follow.
  void begin(const Cell& child);
  /// Adds the decoded splats of one of its bricks. Sums follow the order of the calls and of the splats.
  void add(const BrickSplats& brick);
  MergedOctant finish();
  /// The values of the splats that finish() gives: [variable][splat].
  std::vector<std::vector<SplatScalar>> finishValues();

 private:
  size_t voxelOf(const RootPosition& position) const;
  RootPosition voxelCorner(size_t voxel) const;

  const RootCube root_;
  const size_t variables_;
  const bool even_;
  const double unit_;  // world units of a step of RootPosition
  VoxelMerger voxels_;
  Cell child_;
  int shift_ = 0;  // of a position, to its voxel
  std::vector<SplatScalar> values_;
};

/// The brick of the parent of the octants' cells.
BrickSplats joinOctants(const Cell& cell, size_t variables, std::array<MergedOctant, 8>&& octants);

}  // namespace curvisplat
