// How the CPU's painter keeps a frame: square tiles, one after the other in rows, each small enough for a
// core's nearest cache, each painted by one thread at a time.
//
//   tile    8 x 8 blocks in rows           16 KiB
//   block   4 x 4 pixels                   256 bytes, 4 cache lines
//   in it   red [16], green [16], blue [16] (premultiplied), transmittance [16], each in rows of 4
//
// A block is one vector of 16 floats a channel, or a few narrower ones: no vector is ever partly filled or
// unaligned, and a small splat touches few.
#pragma once

#include <cstdint>
#include <span>

#include "render/projection.h"
#include "render/shading_table.h"

namespace curvisplat {

inline constexpr int kBlockSide = 4;
inline constexpr int kBlockPixels = kBlockSide * kBlockSide;
inline constexpr int kBlockFloats = 4 * kBlockPixels;
inline constexpr int kTileSide = 32;
inline constexpr int kTileBlocks = kTileSide / kBlockSide;  // along a side
inline constexpr int kTileFloats = 4 * kTileSide * kTileSide;

/// Splats to be painted over one tile.
struct TileWork {
  float* tile;  // [kTileFloats], on a cache line
  int x, y;     // of its first pixel
  std::span<const ScreenSplat> splats;
  std::span<const uint32_t> order;  // of `splats`, farthest first
  const ShadingTable& table;
  bool per_pixel;
};

/// Paints in the widest vectors that the processor has. Pure but for the tile: any thread. Every pixel's
/// arithmetic is the same in all of them: the bits are too, where there are fused multiply-adds.
void paintTile(const TileWork& work);

/// Coefficients of x^n: F(rho) / x², x = 1 - (rho / support)², to within 2e-4 of F.
inline constexpr int kFootprintTerms = 9;
const float* footprintPolynomial();  // [kFootprintTerms]

}  // namespace curvisplat
