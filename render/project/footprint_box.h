// The rectangle of the screen that a splat's footprint fills.
#pragma once

#include <cmath>

#include "render/project/kernel.h"
#include "render/project/screen_box.h"
#include "render/project/screen_splat.h"

namespace curvisplat {

/// In pixels. Not of records (isRecord).
inline ScreenBox footprintBox(const ScreenSplat& splat) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float reach_x = kSupport * splat.l11;
  const float reach_y = kSupport * (std::abs(splat.l21) + splat.l22);
  return {splat.x - reach_x, splat.y - reach_y, splat.x + reach_x, splat.y + reach_y};
}

}  // namespace curvisplat
