// The GLSL that projects stored bricks, in orthographic views or in perspective. It does what projection.cpp
// does, except that perspective cuts no splats, and computes the keys of DepthKeys::setKeys().
// project_pieces.h has how splats are drawn once they are projected.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace curvisplat {

/// A stored brick is this many arrays, one after the other, with an element for each splat: those of
/// GeometryArrays, then those of VariableArrays, in their order; in pictures of two scalars those of the second as
/// well.
inline constexpr size_t kStoredArrays = 17, kStoredColourArrays = 5;
/// The fates of splats that the shader counts: off screen, transparent, drawn, in pieces, clipped, hidden.
inline constexpr size_t kFates = 6;
inline constexpr uint32_t kProjectThreads = 256;

/// A brick's part as the shader reads it.
struct ShaderPart {
  uint32_t base, splats;  // where the brick begins in the store, in words; its splats
  int32_t key;            // DepthKeys::Linear
  float inverse_base;
  uint32_t first, last;                                       // KeyRange
  float x, y;                                                 // OrthographicMap
  float origin_x, origin_y, origin_z, from_base, order_base;  // PerspectiveMap
  float eye_x, eye_y, eye_z;                                  // LocalLight, in perspective
  uint32_t splats_in_pieces;                                  // BrickPieces::splats, which follow the arrays
  uint32_t first_plane;                                       // of the clip planes that may cut its splats
  uint32_t kinds;                // bits 0-7: how many planes; bit 8: its splats may meet layers
  float layer_offset;            // orthographic: from its depths to those of layers
  float node_x, node_y, node_z;  // LocalShadows: the origin among the lattice's nodes
  float unused;
};
static_assert(sizeof(ShaderPart) == 96);

/// The splats of a work group: `count` splats of a part, from number `first` on, which go to `slot`. The number is that in
/// the brick, or in BrickPieces::splats.
struct ShaderGroup {
  uint32_t part, first, count, slot;
};

/// The source of the compute shader for views in perspective, or for orthographic ones.
std::string projectShader(bool perspective);

}  // namespace curvisplat
