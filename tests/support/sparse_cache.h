// A cache with as many bricks as that of a very large grid, and hardly any bytes: its streams are holes in sparse
// files, but those of its coarsest three levels, which can be drawn.
#pragma once

#include <cstdint>
#include <filesystem>

namespace curvisplat {

/// Its bricks of levels 0 to 2 hold splats: those of writeLatticeCache().
inline constexpr uint32_t kRealLevels = 3;

/// Writes it to `path`: a full octree of `bricks` bricks, whose deepest level is there in part, with some 11,000 splats
/// a leaf: a million bricks stand for 10^10 nodes. `bricks`: above 73. The scalar "f" is x. Takes 700 bytes of memory a
/// brick meanwhile, and on disk 190.
void writeSparseCache(const std::filesystem::path& path, uint64_t bricks);

}  // namespace curvisplat
