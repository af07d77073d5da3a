// The GLSL that projects stored bricks, in orthographic views or in perspective. It does what projection.cpp
// does with splats that are drawn as they are or in pieces at borders, and computes the keys of
// DepthKeys::setKeys().
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace curvisplat {

/// A stored brick is this many arrays, one after the other, with an element for each splat: those of
/// GeometryArrays, then those of VariableArrays, in their order.
inline constexpr size_t kStoredArrays = 17;
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
  uint32_t unused[3];
};
static_assert(sizeof(ShaderPart) == 80);

/// The elements that a piece is drawn as: its ScreenCut, or nothing, and then itself.
inline constexpr uint32_t kElementsAPiece = 2;

/// The splats of a work group: `count` splats of a part, from number `first` on, which go to `slot`. The number is that in
/// the brick, or in BrickPieces::splats.
struct ShaderGroup {
  uint32_t part, first, count, slot;
};

/// The source of the compute shader for views in perspective, or for orthographic ones.
std::string projectShader(bool perspective);

}  // namespace curvisplat
