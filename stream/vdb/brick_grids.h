// bricks.vdb: the octree as OpenVDB Int32Grids, for any tool that reads VDB files. There is one grid per
// level, named "level 0", "level 1" and so on. A voxel is a cell of the octree, its value is the index of the
// cell's first brick, and the background value is -1. The grid's transform places voxels where the cells are
// in the world. Its unit of length is the grid's metadata "world_units" in world units: 1, or a smaller power
// of two where OpenVDB would refuse voxels as small as the smallest cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stream/model/octree.h"

namespace curvisplat {

/// The bytes of the file. They depend only on the octree and on OpenVDB's version.
std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks);

/// The memory that OpenVDB's trees take while the file is made: up to 0.3 MB for a brick that is far from all
/// others.
uint64_t brickGridsMemory(std::span<const Brick> bricks);

/// The result of comparing a bricks.vdb with an octree. At most one of the two is set, to one line of text.
struct BrickGridsComparison {
  std::string difference;    // what is wrong with the file
  std::string not_compared;  // why the comparison was impossible
};

inline constexpr uint64_t kMaxComparisonMemory = uint64_t{1} << 30;

/// Makes the file again and compares the bytes. The file is not parsed, because OpenVDB's parser trusts its
/// input. Files from another version of OpenVDB, or in a compression that this build of OpenVDB lacks, cannot
/// be compared. Octrees whose trees would take more than `most_memory` bytes are not compared.
BrickGridsComparison compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                       std::span<const Brick> bricks,
                                       uint64_t most_memory = kMaxComparisonMemory);

}  // namespace curvisplat
