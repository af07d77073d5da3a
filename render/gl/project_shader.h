// The GLSL that projects stored bricks, in orthographic views or in perspective. It does what projection.cpp
// does, except that perspective cuts no splats, and computes the keys of DepthKeys::setKeys().
// project_pieces.h has how splats are drawn once they are projected.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace curvisplat {

/// A stored brick's geometry is this many arrays, one after the other, with an element for each splat: those of
/// GeometryArrays, in their order. Then BrickPieces::splats and BrickPieces::pieces. Its values lie elsewhere: the arrays of
/// VariableArrays, in pictures of two scalars those of the second as well, then BrickPieces::drawn_slopes and
/// BrickPieces::values.
inline constexpr size_t kGeometryArrays = 12, kValueArrays = 5;
/// The fates of splats that the shader counts: off screen, transparent, drawn, in pieces, clipped, hidden.
inline constexpr size_t kFates = 6;
inline constexpr uint32_t kProjectThreads = 256;

/// A brick's part as the shader reads it.
struct ShaderPart {
  uint32_t base, splats;  // where the brick's geometry begins in its page, in words; its splats
  int32_t key;            // DepthKeys::Linear
  float inverse_base;
  uint32_t first, last;                                       // KeyRange
  float x, y;                                                 // OrthographicMap
  float origin_x, origin_y, origin_z, from_base, order_base;  // PerspectiveMap
  float eye_x, eye_y, eye_z;                                  // LocalLight, in perspective
  uint32_t splats_in_pieces;                                  // how many BrickPieces::splats
  uint32_t first_plane;  // of the clip planes that may cut its splats, in vectors from the first part on
  uint32_t kinds;        // bits 0-7: how many planes; 8: its splats may meet layers; 9: its fates are counted
  float layer_offset;    // orthographic: from its depths to those of layers
  float node_x, node_y, node_z;  // LocalShadows: the origin among the lattice's nodes
  uint32_t values_base;          // where its values begin, as `base`
};
static_assert(sizeof(ShaderPart) == 96);

/// The splats of a work group: `count` splats of a part, from number `first` on. The number is that in the brick, and they go
/// to `slot`; or that in BrickPieces::splats, and the brick's first piece would go to `slot`, modulo 2^32.
struct ShaderGroup {
  uint32_t part, first, count, slot;
};

/// The source of the compute shader for views in perspective, or for orthographic ones.
std::string projectShader(bool perspective);

}  // namespace curvisplat
