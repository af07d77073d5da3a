#include "render/frame/frame_budget.h"

#include <algorithm>

#include "render/frame/sweep_buffer.h"
#include "render/project/projection.h"
#include "stream/base/byte_text.h"
#include "stream/base/error.h"
#include "stream/base/thread_count.h"
#include "stream/model/brick.h"
#include "stream/model/splats.h"

namespace curvisplat {
namespace {

// A worker's memory: what reading keeps on its thread (a brick's bytes and the decoder's scratch memory), a
// decoded brick (16 numbers per splat), the projector's splats and depths, keys, two sorters, the stack.
constexpr uint64_t kReadingBytes = 12 << 20;
constexpr uint64_t kWorkerBytes = kReadingBytes + uint64_t{kMaxBrickSplats} * 16 * sizeof(float) +
                                  BrickProjector::kMaxSplats * (sizeof(ScreenSplat) + sizeof(float)) +
                                  BrickProjector::kMaxSplats * (4 + 2 * sizeof(DepthItem)) +
                                  SweepBuffer::kMaxBatch * 2 * sizeof(DepthItem) + (1 << 20);
// In pictures of two scalars: the second one's values, and a record for each splat.
constexpr uint64_t kSecondScalarBytes =
    uint64_t{kMaxBrickSplats} * (5 * sizeof(float) + sizeof(ScreenSplat) + 8 + 2 * sizeof(DepthItem));
// These have what they need first. More workers take half of the memory at most: where little is left for splats, the picture is
// drawn in many regions, and bricks are prepared again for each.
constexpr uint64_t kFirstWorkers = 2;
constexpr uint64_t kMinRingBytes = 32768 * sizeof(ScreenSplat);
constexpr uint64_t kMinSweepBytes = SweepBuffer::bytes(73728);
// Larger buffers do not make a frame faster: they only even out bricks that take different times.
constexpr uint64_t kMaxRingBytes = 16 << 20;
constexpr uint64_t kMaxPagerBytes = 32 << 20;
// The image, the painter and the index together get whole sixteenths of the memory if there is enough: a
// picture of a slightly different size then needs no new pools, and the cache keeps its bricks.
constexpr uint64_t kParts = 16;
constexpr uint64_t kKeptArrays = 15;  // five of each step

}  // namespace

FrameBudget FrameBudget::of(uint64_t memory_bytes, const Fixed& fixed, unsigned threads) {
  const uint64_t image_bytes = 4 * sizeof(float) * fixed.size.pixels();
  const uint64_t exact = fixed.index_bytes + fixed.painter_bytes + image_bytes + fixed.output_bytes;
  const uint64_t pools = kMinRingBytes + kMinSweepBytes + fixed.least_pager_bytes;
  const uint64_t worker_bytes = kWorkerBytes + (fixed.two_scalars ? kSecondScalarBytes : 0);
  const uint64_t least = exact + pools + worker_bytes;
  if (memory_bytes < least)
    throw UsageError("--memory {}: too little for {}x{} pixels of this cache; give at least {} MiB",
                     byteText(memory_bytes), fixed.size.width, fixed.size.height, (least >> 20) + 1);
  const uint64_t part = memory_bytes / kParts;
  const uint64_t rounded = (exact + part - 1) / part * part;
  const unsigned wanted = threadsOrCores(threads);
  FrameBudget budget;
  const uint64_t taken = rounded + pools + wanted * worker_bytes <= memory_bytes ? rounded : exact;
  const uint64_t fit = (memory_bytes - taken - pools) / worker_bytes;
  budget.workers =
      static_cast<unsigned>(std::min<uint64_t>(wanted, std::max(std::min(fit, kFirstWorkers), fit / 2)));
  const uint64_t free = memory_bytes - taken - pools - budget.workers * worker_bytes;
  const uint64_t share = free / 4;
  const uint64_t ring_bytes = std::min(kMinRingBytes + share, kMaxRingBytes);
  budget.ring_splats = ring_bytes / sizeof(ScreenSplat);
  budget.pager_bytes =
      std::max(fixed.least_pager_bytes, std::min(fixed.least_pager_bytes + share, kMaxPagerBytes));
  const uint64_t most_sweep_bytes = std::max(kMinSweepBytes, SweepBuffer::bytes(fixed.splats));
  uint64_t rest = free - (ring_bytes - kMinRingBytes) - (budget.pager_bytes - fixed.least_pager_bytes);
  // Ranks wait for each other at the end of each slab; one process gains more from bricks that stay decoded.
  const uint64_t sweep_share = fixed.several_ranks ? rest * 7 / 8 : free * 3 / 8;
  const uint64_t sweep_bytes = std::min(kMinSweepBytes + sweep_share, most_sweep_bytes);
  budget.sweep_splats = sweep_bytes / SweepBuffer::bytes(SweepBuffer::kPageSplats) * SweepBuffer::kPageSplats;
  rest -= sweep_bytes - kMinSweepBytes;
  // Of a series, the values of three steps are kept for each brick: the step, and the two that it is predicted from.
  budget.kept_bytes = fixed.is_series ? rest * kKeptArrays / (kArraysOfSplats + kKeptArrays) : 0;
  budget.cache_bytes = rest - budget.kept_bytes;
  return budget;
}

}  // namespace curvisplat
