// How a frame's memory is shared out between the stages.
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/camera.h"

namespace curvisplat {

struct FrameBudget {
  unsigned workers = 1;
  size_t ring_splats = 0;

  /// The largest shares within `memory_bytes`, for at most `threads` workers (0: one a core). `fixed_bytes`
  /// is what the octree takes already and the painter will. Throws UsageError saying how much the least is.
  static FrameBudget of(uint64_t memory_bytes, uint64_t fixed_bytes, ImageSize size, unsigned threads);
};

}  // namespace curvisplat
