// The order in which splats are drawn: each tile of the picture has its own.
//
// Splats that overlap have no order that is right for all pixels: where cells are wide and thin and are seen
// obliquely, the layers of one column of cells lie before those of the next in one pixel, and behind them in
// another. So in each tile of kOrderSide pixels, splats come by the depths at which the planes that they lie
// in (plane_block.h) meet the tile's middle:
//
//   key in a tile = key + slope · (the tile's middle - the splat's centre), no less than `first`
//
// Keys are integers that increase in drawing order (depth_sort.h). Splats with equal keys in a tile come by
// `first`, then by brick, then by number: in the order in which the sweep releases them, which is that of
// `first`. All that a tile's order depends on is the splats themselves.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"
#include "stream/model/kernel.h"

namespace curvisplat {

/// Pixels along a tile that has one order.
inline constexpr int kOrderSide = 4;
static_assert(kTileSide % kOrderSide == 0 && kSharedTileSide % kOrderSide == 0);

/// Pixels of depth a pixel: planes that are steeper are taken for this steep, some 80 degrees. It bounds how
/// far before its centre a splat may come.
inline constexpr float kSteepest = 6;

/// Whether a splat comes at different depths in different tiles.
inline bool leans(const ScreenSplat& splat) {
  return splat.key_slope0 != 0 || splat.key_slope1 != 0;
}

/// The splat's key in the tile with its middle at (x, y).
inline uint32_t keyAt(const ScreenSplat& splat, float x, float y) {
  const float moved = splat.key_slope0 * (x - splat.x) + splat.key_slope1 * (y - splat.y);
  constexpr float kMaxSteps = 0x1p32f;  // steps: all there are
  const float held = !(moved > -kMaxSteps) ? -kMaxSteps : moved > kMaxSteps ? kMaxSteps : moved;
  const int64_t key = int64_t{splat.key} + static_cast<int64_t>(held);
  if (key < int64_t{splat.first}) return splat.first;
  return static_cast<uint32_t>(std::min(key, int64_t{UINT32_MAX - 1}));
}

/// How much before its centre's key a splat may come in any tile that it touches. In steps.
inline float mostBefore(const ScreenSplat& splat) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float across = splat.l11 * splat.key_slope0 + splat.l21 * splat.key_slope1;
  const float down = splat.l22 * splat.key_slope1;
  return kSupport * std::sqrt(across * across + down * down) +
         0.5f * kOrderSide * (std::abs(splat.key_slope0) + std::abs(splat.key_slope1)) + 1;
}

}  // namespace curvisplat
