// Faces of the grid as surfaces: the outer faces of blocks and chosen index planes, each a lattice of nodes, cut
// into patches at several levels of detail. faces.bin holds them; stream/FORMAT.md, "faces.bin", has the bytes.
//
// A patch takes every stride-th node of its part of the lattice, and the lattice's last. Finest patches have
// strides of 1. Patches of the next level have a stride twice as large along u, v or both, and replace their
// children.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "stream/model/octree.h"

namespace curvisplat {

inline constexpr uint32_t kPatchQuads = 64;  // of a patch along u and v, at most
inline constexpr uint32_t kNoPatch = 0xffffffff;

enum class FaceSide : uint8_t {
  kMin,
  kMax,
  kPlane  // an index plane that was chosen; it may be an end as well
};

/// The nodes of a block with one index along an axis. u and v are the other two axes, in their order.
struct GridFace {
  uint32_t block = 0;  // from 0
  int axis = 0;        // 0, 1, 2: i, j, k
  FaceSide side = FaceSide::kMin;
  uint64_t index = 0;
  std::array<uint64_t, 2> nodes{};  // along u and v; at least 2
  uint32_t root = kNoPatch;         // the coarsest patch, which covers the whole face
};

/// A patch of a face at one level of detail: every stride-th node from `first` on.
struct FacePatch {
  uint32_t face = 0;
  std::array<uint64_t, 2> first{};   // node of the lattice
  std::array<uint32_t, 2> stride{};  // powers of two
  std::array<uint16_t, 2> nodes{};   // 2 to kPatchQuads + 1
  uint32_t first_child = kNoPatch, child_count = 0;
  float error = 0;  // longest edge of a quad, world units; 0 at the finest level
  glm::dvec3 lower{0.0}, upper{0.0};
  Extent extent;

  size_t nodeCount() const { return size_t{nodes[0]} * nodes[1]; }
  size_t quadCount() const { return size_t{nodes[0] - 1u} * (nodes[1] - 1u); }
};

/// A part of a face that has a name: a boundary condition. Nodes [first, last] of the lattice.
struct FaceRegion {
  uint32_t face = 0;
  std::array<uint64_t, 2> first{}, last{};
  std::string name, type;  // "Wing", "BCWallViscous"
};

/// The nodes of a patch, row after row along u. A node that is not there has the place of the one before it.
struct PatchNodes {
  std::vector<glm::dvec3> positions;        // world units
  std::vector<uint8_t> quads;               // 1: drawn; row after row
  std::vector<std::vector<float>> scalars;  // [variable of the file]
};

/// Lattice index of a patch's node number `n` along u (0) or v (1).
inline uint64_t latticeIndex(const GridFace& face, const FacePatch& patch, size_t along, uint64_t n) {
  return std::min(patch.first[along] + n * patch.stride[along], face.nodes[along] - 1);
}

/// Coordinates of all faces of a file are whole multiples of a step from the lowest corner of a box.
struct FaceBox {
  static constexpr uint32_t kSteps = (1u << 26) - 1;

  glm::dvec3 lower{0.0}, step{0.0};

  static FaceBox of(const glm::dvec3& lower, const glm::dvec3& upper) {
    return {lower, (upper - lower) / static_cast<double>(kSteps)};
  }
  glm::dvec3 at(const std::array<uint32_t, 3>& code) const {
    return lower + step * glm::dvec3(code[0], code[1], code[2]);
  }
};

}  // namespace curvisplat
