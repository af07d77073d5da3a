// A small cache whose pictures can be worked out by hand: 32³ unit cells with a linear scalar, as an octree
// of three levels.
#pragma once

#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>

namespace curvisplat {

inline constexpr int kLatticeSide = 32;  // cells along an axis: the data is the cube [0, 32]³
inline constexpr int kLatticeBricks = 1 + 8 + 64;

/// Writes it to `path`. The scalar "f" at x is constant + gradient · x. Every brick has 8³ splats; the inner
/// ones are merged exactly.
void writeLatticeCache(const std::filesystem::path& path, double constant, const glm::dvec3& gradient);

}  // namespace curvisplat
