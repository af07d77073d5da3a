// bricks.vdb: the octree as OpenVDB Int32Grids, for any tool that reads VDB files. One grid a level, named
// "level 0", "level 1", ...: a voxel is a cell, its value the first brick of that cell, the background -1;
// the transform puts voxels where the cells are in the world, in units of so many world units as the grid's
// metadata "world_units" says: 1, unless OpenVDB would refuse the smallest cells.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "stream/brick.h"

namespace curvisplat {

/// The file's bytes: the same for the same octree.
std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks);

/// What is wrong with `bytes` as the file of that octree, a line; empty if nothing is. OpenVDB's parser
/// trusts what it reads, so it is not asked: the file is made again and compared. One by another version of
/// OpenVDB cannot be, and has nothing wrong with it.
std::string differenceFromBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                     std::span<const Brick> bricks);

}  // namespace curvisplat
