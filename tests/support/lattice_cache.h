// A small cache whose pictures can be worked out by hand: 32³ unit cells with a linear scalar, as an octree
// of three levels.
#pragma once

#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>

#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"

namespace curvisplat {

inline constexpr int kLatticeSide = 32;  // cells along an axis: the data is the cube [0, 32]³
inline constexpr int kLatticeBricks = 1 + 8 + 64;

/// Writes it to `path`. The scalar "f" at x is constant + gradient · x. Every brick has 8³ splats; the inner
/// ones are merged exactly.
void writeLatticeCache(const std::filesystem::path& path, double constant, const glm::dvec3& gradient);

struct LatticeBrick {
  double constant = 0;
  glm::dvec3 gradient{0.0};
  bool leaf = false;
};
/// 8³ splats in a cell of that cache, of level 2 at most.
BrickSplats latticeBrick(const RootCube& root, const Cell& cell, const LatticeBrick& of);

}  // namespace curvisplat
