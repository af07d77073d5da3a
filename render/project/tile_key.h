// The order in which splats are drawn: each tile of the picture has its own.
//
// Splats that overlap have no order that is right for all pixels: where cells are wide and thin and are seen
// obliquely, the layers of one column of cells lie before those of the next in one pixel, and behind them in
// another. So in each tile of kOrderSide pixels, splats come by the depths at which the planes that they lie
// in (plane_block.h) meet the tile's middle:
//
//   key in a tile = key + slope · (the tile's middle - the splat's centre), no less than `first`
//
// Keys are integers below 2^31 that increase in drawing order (depth_sort.h). A splat's `first` is about the
// least key that it has in a tile, never more (setFirst()); the sweep releases splats by it. Splats with
// equal keys in a tile come by `first`, then by brick, then by number, as the sweep releases them. So a
// tile's order depends on nothing but the splats themselves.
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

/// The steepest slope of a splat's plane, in pixels of depth a pixel, some 80 degrees; steeper ones count as
/// this. It bounds how far before its centre a splat may come.
inline constexpr float kSteepest = 6;

/// Whether a splat comes at different depths in different tiles.
inline bool leans(const ScreenSplat& splat) {
  return splat.key_slope0 != 0 || splat.key_slope1 != 0;
}

/// How far the key in a tile may lie from the splat's own, in keys, at the most: all there are (DepthKeys).
inline constexpr float kMaxSteps = 0x1p30f;

/// The splat's key in the tile with its middle at (x, y).
inline uint32_t keyAt(const ScreenSplat& splat, float x, float y) {
  const float moved = splat.key_slope0 * (x - splat.x) + splat.key_slope1 * (y - splat.y);
  const float held = std::clamp(moved, -kMaxSteps, kMaxSteps);
  const int32_t key = static_cast<int32_t>(splat.key) + static_cast<int32_t>(held);
  return static_cast<uint32_t>(std::max(key, static_cast<int32_t>(splat.first)));
}

/// The order tiles that a splat's rectangle touches along x or y: their numbers, from `first` to `last`,
/// which is included.
struct OrderTileSpan {
  float first, last;

  /// `centre`, `reach`: pixels.
  static OrderTileSpan of(float centre, float reach) {
    constexpr float kPerPixel = 1.0f / kOrderSide;
    return {std::floor((centre - reach) * kPerPixel), std::floor((centre + reach) * kPerPixel)};
  }
  /// The least that `slope` adds from `centre` to the middle of one of them.
  float least(float centre, float slope) const {
    constexpr float kHalf = 0.5f * kOrderSide;
    return std::min(slope * (first * kOrderSide + kHalf - centre),
                    slope * (last * kOrderSide + kHalf - centre));
  }
};

/// How much less than its centre's key a splat's key may be in any tile that its ellipse touches.
inline float mostBefore(const ScreenSplat& splat) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float across = splat.l11 * splat.key_slope0 + splat.l21 * splat.key_slope1;
  const float down = splat.l22 * splat.key_slope1;
  return kSupport * std::sqrt(across * across + down * down) +
         0.5f * kOrderSide * (std::abs(splat.key_slope0) + std::abs(splat.key_slope1)) + 1;
}

/// Sets `first` of a splat whose other members are set. A splat that touches a single tile no longer leans
/// afterwards: it gets the key that it has there.
inline void setFirst(ScreenSplat& splat) {
  splat.first = splat.key;
  if (!leans(splat)) return;
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const auto columns = OrderTileSpan::of(splat.x, kSupport * splat.l11);
  const auto rows =
      OrderTileSpan::of(splat.y, kSupport * std::sqrt(splat.l21 * splat.l21 + splat.l22 * splat.l22));
  const float least = columns.least(splat.x, splat.key_slope0) + rows.least(splat.y, splat.key_slope1);
  const float before = std::min(1 - least, mostBefore(splat));
  if (before > 0)
    splat.first -= std::min(splat.key, static_cast<uint32_t>(std::min(before, 0x1p31f)));
  else
    splat.first += static_cast<uint32_t>(std::min(0x1p30f, -before));
  if (columns.first != columns.last || rows.first != rows.last) return;
  splat.key = splat.first;
  splat.key_slope0 = splat.key_slope1 = 0;
}

}  // namespace curvisplat
