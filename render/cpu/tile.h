// How the CPU's painter keeps a frame: square tiles, one after the other in rows, each small enough for a
// core's nearest cache, each painted by one thread at a time.
//
//   tile    8 x 8 blocks in rows           16 KiB
//   block   4 x 4 pixels                   256 bytes, 4 cache lines
//   in it   red [16], green [16], blue [16] (premultiplied), transmittance [16], each in rows of 4
//
// Splats come nearest first, and each is blended under what is there: a block behind which nothing can be
// seen takes no more. Let T < kSaturated be the largest transmittance of its pixels then. What would still
// have been added to any of them is T times what the rest makes of a colour or an opacity in 0..1: less than
// 1/4096, a sixteenth of a step of 8 bits, and the picture so 72 dB or more from the one with everything in
// it. A block's state after so many splats is the same however they were batched, and so are the bits.
//
// A block is one vector of 16 floats a channel, or a few narrower ones: no vector is ever partly filled or
// unaligned, and a small splat touches few.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "render/cpu/shading_table.h"
#include "render/project/painter.h"
#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"

namespace curvisplat {

inline constexpr int kBlockSide = 4;
inline constexpr int kBlockPixels = kBlockSide * kBlockSide;
inline constexpr int kBlockFloats = 4 * kBlockPixels;
inline constexpr int kTileBlocks = kTileSide / kBlockSide;  // along a side
inline constexpr int kTileFloats = 4 * kTileSide * kTileSide;

// A splat's mean extinction, and colour times extinction, are looked up for every pixel, or where a constant
// or a parabola over the splat (or 4x4 of its pixels) is known to be no farther from that than this part of
// the largest extinction there (of all splats together less than e^-1 / 256 of opacity), or this optical
// depth. The flat splat, one colour for all of it, is the constant.
inline constexpr float kRelativeError = 1.0f / 256;
inline constexpr float kDepthError = 2e-5f;

inline constexpr float kSaturated = 1.0f / 4096;

/// Bit kTileBlocks * row + column: a block.
using BlockMask = uint64_t;
static_assert(kTileBlocks * kTileBlocks == 64);

/// The layers of a tile's pixels, and the windows behind the first (tile_windows.h).
struct TileWindows {
  int layers;     // the most of any pixel
  float* depths;  // [layers][pixels of the tile, block by block]; infinite where a pixel has fewer
  float* behind;  // [windows - 1][kTileFloats]
  std::array<uint8_t, 64> open;  // of each block: how many windows, from the first, take more
};

/// Splats to be painted under what a tile holds.
struct TileWork {
  float* tile;                          // [kTileFloats], on a cache line
  int x, y;                             // of its first pixel
  BlockMask open;                       // the blocks that are not saturated; has one at least
  std::span<const ScreenSplat> splats;  // one that is cut behind its records
  std::span<const uint32_t> order;      // of `splats`, nearest first
  const ShadingTable& table;
  const ShadingTable* colours;  // of pictures of two scalars; else null
  PixelShading shading;
  TileWindows* windows = nullptr;  // null: no layers, and no splats with a ScreenDepth
};

/// Paints in the widest vectors that the processor has; what is open then. Pure but for the tile: any thread.
/// Every pixel's arithmetic is the same in all of them: the bits are too, where there are fused
/// multiply-adds.
BlockMask paintTile(const TileWork& work);

/// Coefficients of x^n: F(rho) / x², x = 1 - (rho / support)², to within 2e-4 of F.
inline constexpr int kFootprintTerms = 9;
const float* footprintPolynomial();  // [kFootprintTerms]

}  // namespace curvisplat
