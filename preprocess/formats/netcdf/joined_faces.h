// A grid of several faces on a sphere without the gaps between them. Blocks are added to the faces': for each joint
// (face_joints.h) one of two nodes across, the last ones of a face and the first ones of its neighbour, and for
// each hole one of 2x2 columns. Their nodes coincide with the faces', so that each becomes one splat (splats/seams.h).
#pragma once

#include <memory>

#include "preprocess/formats/netcdf/face_source.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// `source` has a block for each face, all of the same dimensions. Where its nodes are not on a sphere, the faces stay
/// apart. Throws Error as the source does.
std::unique_ptr<GridSource> joinFaces(std::unique_ptr<FaceSource> source);

}  // namespace curvisplat
