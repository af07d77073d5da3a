// How a frame's memory is shared out between the stages.
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/camera/camera.h"

namespace curvisplat {

struct FrameBudget {
  unsigned workers = 1;
  size_t ring_splats = 0;
  size_t sweep_splats = 0;
  uint64_t pager_bytes = 0;  // bytes as read, ahead of the workers
  uint64_t cache_bytes = 0;  // decoded bricks, kept between frames

  /// What does not depend on the budget.
  struct Fixed {
    uint64_t index_bytes = 0;        // the octree, and what a frame notes about its bricks
    uint64_t least_pager_bytes = 0;  // the largest brick's
    uint64_t painter_bytes = 0;      // beside the picture
    uint64_t output_bytes = 0;       // for what is done with the picture
    uint64_t splats = 0;             // that any picture has, at the most
    ImageSize size;
  };
  /// The shares within `memory_bytes`, for at most `threads` workers (0: one a core): workers first, then the
  /// ring, the pager and the sweep up to what serves them, then the cache. Images of up to a sixteenth of the memory
  /// have the same shares. Throws UsageError saying how much the least is.
  static FrameBudget of(uint64_t memory_bytes, const Fixed& fixed, unsigned threads);

  bool operator==(const FrameBudget&) const = default;
};

}  // namespace curvisplat
