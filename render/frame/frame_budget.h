// Divides a frame's memory among its stages.
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/camera/camera.h"

namespace curvisplat {

struct FrameBudget {
  unsigned workers = 1;
  size_t ring_splats = 0;
  size_t sweep_splats = 0;
  uint64_t pager_bytes = 0;  // encoded bricks that are read ahead of the workers
  uint64_t cache_bytes = 0;  // decoded bricks that are kept between frames
  uint64_t kept_bytes = 0;   // decoded values of several time steps, kept between frames

  /// Requirements that do not depend on the budget.
  struct Fixed {
    uint64_t index_bytes = 0;        // the octree, and a frame's notes about its bricks
    uint64_t least_pager_bytes = 0;  // what the largest brick needs
    uint64_t painter_bytes = 0;      // in addition to the picture
    uint64_t output_bytes = 0;       // reserved for the use of the finished picture
    uint64_t splats = 0;             // the most that any picture can have
    ImageSize size;
    bool is_series = false;      // of several time steps
    bool two_scalars = false;    // splats have ScreenColours
    bool several_ranks = false;  // draw the picture together
  };
  /// Divides `memory_bytes` for at most `threads` workers (0: one per core). Two workers come first, more take half
  /// at most; then the ring, the pager and the sweep, each up to the size from which more does not help; the cache
  /// gets the rest. Pictures of different sizes have the same shares as long as their needs lie in the same sixteenth
  /// of the memory. Throws UsageError if `memory_bytes` is too little; the message says how much is needed.
  static FrameBudget of(uint64_t memory_bytes, const Fixed& fixed, unsigned threads);

  bool operator==(const FrameBudget&) const = default;
};

}  // namespace curvisplat
