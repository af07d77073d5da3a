// The GLSL that projects stored bricks: what projection.cpp does with splats that are drawn as they are or in pieces at
// borders, in orthographic views or in perspective, and what DepthKeys::setKeys() does with their keys.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace curvisplat {

/// Arrays of a stored brick, one after the other, [splats] each: those of GeometryArrays, then those of VariableArrays,
/// in their order.
inline constexpr size_t kStoredArrays = 17;
inline constexpr uint32_t kProjectThreads = 256;

/// A brick's part as the shader reads it.
struct ShaderPart {
  uint32_t base, splats;  // of the brick, in words of the store
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

/// What a piece is drawn as: its ScreenCut, or nothing, and itself.
inline constexpr uint32_t kElementsAPiece = 2;

/// A work group's splats: `count` of a part, from `first` of its brick on, or of those in pieces; and where they go.
struct ShaderGroup {
  uint32_t part, first, count, slot;
};

std::string projectShader(bool perspective);

}  // namespace curvisplat
