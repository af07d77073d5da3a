// Draws triangles of at most 64 pixels into the samples of a tile, in the widest vectors there are.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "render/surface/pixel_samples.h"
#include "render/surface/scene_triangles.h"

namespace curvisplat {

/// Pixels: products of a small triangle's differences have fewer bits than a float.
inline constexpr int kSmallTriangle = 64;

struct SmallTriangles {
  const ScreenVertex* vertices;
  const std::array<uint32_t, 3>* triangles;
  std::span<const uint32_t> numbers;  // of those to draw
  uint32_t first_number = 0;          // of triangle 0, in the scene
};

/// Pixels [x0, x1] x [y0, y1] of the picture, with rows of kSampleTileWidth.
struct SampleBox {
  PixelSamples* samples;
  const PixelSamples* before;  // only what lies behind these is drawn; may be null
  int x0, y0, x1, y1;
};

/// Draws the small ones. Writes the others to `left` ([numbers]), and returns how many they are. The same bits in
/// all instruction sets.
size_t drawSmallTriangles(const SmallTriangles& work, const SampleBox& box, uint32_t* left);

}  // namespace curvisplat
