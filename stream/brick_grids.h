// bricks.vdb: the octree as OpenVDB Int32Grids, for any tool that reads VDB files. One grid a level, named
// "level 0", "level 1", ...: a voxel is a cell, its value the first brick of that cell, the background -1;
// the transform puts voxels where the cells are in the world, in units of so many world units as the grid's
// metadata "world_units" says: 1, unless OpenVDB would refuse the smallest cells.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stream/brick.h"

namespace curvisplat {

/// The file's bytes: the same for the same octree.
std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks);

/// Compares the file with the octree; gives what differs, a line each, at most 16. Throws Error if OpenVDB
/// cannot read it. The file's checksum should have been checked before: OpenVDB trusts what it reads.
std::vector<std::string> compareBrickGrids(const std::filesystem::path& file, std::span<const Brick> bricks);

}  // namespace curvisplat
