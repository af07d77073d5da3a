// A cache that does not compress: random splats in an octree of three levels, bricks of very different sizes.
#pragma once

#include <cstdint>
#include <filesystem>

namespace curvisplat {

/// Writes it to `path`: a root, eight cells below it, and under each of them two to eight leaves, one of them
/// in two bricks. One scalar. Inner bricks hold splats by octant and of their children's weight.
void writeRandomCache(const std::filesystem::path& path, uint64_t seed = 1, size_t most_splats = 3000);

}  // namespace curvisplat
