// The stream of a patch of a grid's face (stream/model/grid_faces.h).
//
//   PatchHeader | PatchScalar x variables | zstd frame: bits of the quads | planes of x, y, z | planes of each scalar
//
// Coordinates are whole numbers of steps of the file's box, so a node has the same place in every patch that has
// it: patches share their borders exactly. Scalars have 16 bits over the patch's own range.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/planes.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

struct PatchHeader {
  uint16_t nodes_u = 0, nodes_v = 0;  // 0
  uint32_t variables = 0;             // 4
  std::array<ArrayCode, 3> arrays;    // 8: x, y, z
  uint16_t reserved = 0;              // 14
};                                    // 16
static_assert(sizeof(PatchHeader) == 16);

struct PatchScalar {
  float lower = 0, upper = 0;  // 0: range
  ArrayCode array;             // 8
  uint16_t reserved = 0;       // 10
};                             // 12
static_assert(sizeof(PatchScalar) == 12);

/// A patch before it is encoded: rows of `columns` nodes along u.
struct PatchLattice {
  uint16_t columns = 0, rows = 0;
  std::array<std::vector<uint32_t>, 3> codes;  // steps of the FaceBox
  std::vector<uint8_t> quads;                  // 1: drawn
  std::vector<std::vector<float>> scalars;
};

std::vector<std::byte> encodePatch(const PatchLattice& patch);

/// Decodes untrusted bytes: throws Error unless they hold the nodes that `patch` has, with `variables` scalars.
PatchNodes decodePatch(const FacePatch& patch, size_t variables, const FaceBox& box,
                       std::span<const std::byte> bytes);

}  // namespace curvisplat
