#include "render/frame_budget.h"

#include <algorithm>
#include <thread>

#include "render/projection.h"
#include "stream/brick.h"
#include "stream/error.h"

namespace curvisplat {
namespace {

// A worker's memory: what reading keeps on its thread (a brick's bytes and the decoder's scratch), a brick
// decoded (15 floats a splat), the projector's splats and depths, the sorter's keys, indices and counters,
// the stack.
constexpr uint64_t kReadingBytes = 12 << 20;
constexpr uint64_t kWorkerBytes = kReadingBytes + uint64_t{kMaxBrickSplats} * 15 * sizeof(float) +
                                  BrickProjector::kMostSplats * (sizeof(ScreenSplat) + sizeof(float)) +
                                  BrickProjector::kMostSplats * (2 * 8 + 4) + (uint64_t{2} << 16) * 4 +
                                  (1 << 20);
constexpr uint64_t kLeastRingBytes = BrickProjector::kMostSplats * sizeof(ScreenSplat);
// More does not make a frame faster: it only bridges bricks that take unequally long.
constexpr uint64_t kMostRingBytes = 64 << 20;

}  // namespace

FrameBudget FrameBudget::of(uint64_t memory_bytes, uint64_t index_bytes, ImageSize size, unsigned threads) {
  // Once in OpenGL's framebuffer and once as the result.
  const uint64_t image_bytes = uint64_t{2} * 4 * sizeof(float) * static_cast<uint64_t>(size.width) *
                               static_cast<uint64_t>(size.height);
  const uint64_t fixed = index_bytes + image_bytes + kLeastRingBytes;
  const uint64_t least = fixed + kWorkerBytes;
  if (memory_bytes < least)
    throw UsageError(
        "{} MiB of memory are too little for {}x{} pixels of this cache; give at least {} MiB with --memory",
        memory_bytes >> 20, size.width, size.height, (least >> 20) + 1);
  const unsigned wanted = threads ? threads : std::max(1u, std::thread::hardware_concurrency());
  FrameBudget budget;
  budget.workers = static_cast<unsigned>(std::min<uint64_t>(wanted, (memory_bytes - fixed) / kWorkerBytes));
  const uint64_t rest = memory_bytes - fixed - budget.workers * kWorkerBytes;
  budget.ring_splats = std::min(kLeastRingBytes + rest, kMostRingBytes) / sizeof(ScreenSplat);
  return budget;
}

}  // namespace curvisplat
