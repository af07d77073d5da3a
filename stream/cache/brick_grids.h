// bricks.vdb: the octree as OpenVDB Int32Grids, for any tool that reads VDB files. One grid a level, named
// "level 0", "level 1", ...: a voxel is a cell, its value the first brick of that cell, the background -1;
// the transform puts voxels where the cells are in the world, in units of so many world units as the grid's
// metadata "world_units" says: 1, unless OpenVDB would refuse the smallest cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stream/model/brick.h"

namespace curvisplat {

/// The file's bytes: the same for the same octree and version of OpenVDB.
std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks);

/// The memory that OpenVDB's trees of these bricks take meanwhile: up to 0.3 MB for a brick that is far from
/// all others.
uint64_t brickGridsMemory(std::span<const Brick> bricks);

/// Of a file against the octree it is to be of: a line or nothing, each.
struct BrickGridsComparison {
  std::string difference;
  std::string not_compared;  // why
};

inline constexpr uint64_t kMaxComparisonMemory = uint64_t{1} << 30;

/// OpenVDB's parser trusts what it reads, so it is not asked: the file is made again and compared. One by
/// another version of OpenVDB, or compressed in a way that this build of it cannot, is not comparable; one
/// whose trees take more than `most_memory` is not compared.
BrickGridsComparison compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                       std::span<const Brick> bricks,
                                       uint64_t most_memory = kMaxComparisonMemory);

}  // namespace curvisplat
