// How a frame fits into its memory: FrameBudget gives each stage its share of it, and frameRegions() divides
// the picture where the sweep's share cannot hold a layer of the whole cut.
//
// Neither changes a bit of the picture: a pixel's bits depend on nothing but its splats and their order.
// Both are computed before anything is read, from the index alone; where a cut has many parts, a sample of
// them stands for all. Pure; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "render/camera/camera.h"
#include "render/frame/frame_plan.h"
#include "render/image/too_little_memory.h"
#include "render/project/tile_set.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The stages' shares of a frame's memory.
struct FrameBudget {
  static constexpr size_t kMinWaitingSplats = 32768;

  unsigned workers = 1;
  size_t ring_splats = 0;
  size_t sweep_splats = 0;
  uint64_t pager_bytes = 0;                   // encoded bricks that are read ahead of the workers
  size_t waiting_splats = kMinWaitingSplats;  // PaintResources::waiting_splats
  uint64_t cache_bytes = 0;                   // decoded bricks that are kept between frames
  uint64_t kept_bytes = 0;                    // decoded values of several time steps, kept between frames

  /// Requirements that do not depend on the budget.
  struct Fixed {
    uint64_t index_bytes = 0;        // the octree, and a frame's notes about its bricks
    uint64_t least_pager_bytes = 0;  // what the largest brick needs
    uint64_t painter_bytes = 0;      // in addition to the picture, with kMinWaitingSplats
    uint64_t output_bytes = 0;       // for what becomes of the finished picture: annotating, encoding
    uint64_t splats = 0;             // the most that any picture can have
    ImageSize size;
    bool is_series = false;      // of several time steps
    bool two_scalars = false;    // splats have ScreenColours
    bool several_ranks = false;  // draw the picture together
  };
  /// Divides `memory_bytes` for at most `threads` workers (0: one per core). Two workers come first; further
  /// ones get at most half. Then come the ring, the pager and the sweep, each up to the size beyond which
  /// more does not help; the cache gets the rest. Pictures of different sizes have the same shares as long as
  /// their needs lie in the same sixteenth of the memory. Throws TooLittleMemory.
  static FrameBudget of(uint64_t memory_bytes, const Fixed& fixed, unsigned threads);

  bool operator==(const FrameBudget&) const = default;
};

/// A rectangle of the picture that is swept on its own.
struct FrameRegion {
  std::shared_ptr<const TileSet> tiles;  // null: all of the picture, drawn by one process
  std::vector<uint8_t> left_out;         // [part of the plan] 1: touches no tile; empty: no part is left out
};

/// Divides a picture into regions that are drawn one after the other, where the memory of the sweep cannot
/// hold a layer of the whole cut (sweep_buffer.h). Where ranks draw a picture together, each divides its own
/// tiles. A region is a rectangle of whole tiles of the painters (except where a rank's tiles end); a smaller
/// region has a smaller layer. Without regions the picture would be drawn in slabs of depth, and a brick
/// prepared again for each slab that it reaches through. With them it is prepared again for each region that
/// it touches, which are fewer: a brick is deep compared with a slab, and small compared with the picture.
///
/// The number of regions is the one with the least estimated work. If a layer is larger than estimated, its
/// region is drawn in slabs. There is at least one region; together they have the plan's tiles, each once.
/// `sweep_splats`: what the sweep can hold. `least`: the fewest regions, if there are that many tiles.
std::vector<FrameRegion> frameRegions(const FramePlan& plan, const CacheReader& cache, size_t variable,
                                      size_t sweep_splats, uint32_t least = 1);
inline constexpr uint32_t kMaxRegions = 64;

/// A part of the cut in a region: its depth keys there, over which its splats are taken to be spread evenly,
/// and their number.
struct PartInRegion {
  KeyRange keys;
  double splats = 0;   // in the region
  double prepare = 0;  // to be prepared for it: all of the part's
};

/// The most splats that a sweep over the parts holds at a time. `parts` in the sweep's order.
double largestLayer(const std::vector<PartInRegion>& parts);

}  // namespace curvisplat
