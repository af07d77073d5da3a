// How much of a brick's error on the screen counts towards the cut (stream/paging/cut.h): all of it, down to a quarter where
// nothing that merging loses can be seen. DESIGN.md, "The cut". Pure.
//
// Merging loses two things. The scalar inside a voxel is known only to within the deviation that its slope leaves, so the
// transfer function is wrong by at most its change within that deviation. And merged kernels do not add up to one: they
// ripple with the voxels' lattice, which shows where a ray passes many voxels at the same place.
#pragma once

#include "stream/model/brick.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// The least weight, for this error allowed on the screen. The detail of bricks that count least is at most 4 pixels: borders
/// show with any function. At 4 pixels and more, and at 0, everything counts (1).
double leastErrorWeight(double lod_pixels);

/// What merging into one voxel loses.
struct VoxelLoss {
  double changed = 0;   // the optical depth that its unknown scalar changes
  double rippling = 0;  // the optical depth that rays pass in step with the lattice
  double share = 0;     // its length, of the data's
};

/// In [least, 1]. Voxels longer than 1/48 of the data count whole: in so few, borders are most of the picture.
double errorWeight(const VoxelLoss& loss, double least);

/// The length, stretched, over which rays pass a lattice in step: voxels of the length `voxel` along the axes, seen by `view`
/// anywhere in the brick's box. At most `whole`, the data's length. For a ray with the direction d it is voxel / (π |d_i|), i the
/// axis that d is nearest to being at right angles to.
double lengthInStep(const Brick& brick, const CutView& view, double voxel, double whole);

}  // namespace curvisplat
