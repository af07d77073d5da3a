#include "render/frame/frame_memory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "render/project/painter.h"
#include "render/project/projection.h"
#include "render/ranks/tile_dealer.h"
#include "render/sweep/sweep_buffer.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"
#include "stream/paging/layer_merger.h"

namespace curvisplat {
namespace {

// A worker's memory: what reading keeps on its thread (a brick's bytes and the decoder's scratch memory), a
// decoded brick (16 numbers per splat), what merges its layers, the projector's splats and depths, keys, two sorters, the stack.
constexpr uint64_t kReadingBytes = 12 << 20;
constexpr uint64_t kWorkerBytes = kReadingBytes + uint64_t{kMaxBrickSplats} * 16 * sizeof(float) +
                                  BrickProjector::kMaxSplats * (sizeof(ScreenSplat) + sizeof(float)) +
                                  BrickProjector::kMaxSplats * (4 + 2 * sizeof(DepthItem)) +
                                  LayerMerger::kBytes + SweepBuffer::kMaxBatch * 2 * sizeof(DepthItem) +
                                  (1 << 20);
// The memory that pictures of two scalars take in addition: the second one's values, and a record for each
// splat.
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
constexpr uint64_t kMaxWaitingBytes = 256 << 20;
// The bytes of a waiting splat: in the queues of tiles (render/tiles/tile_queues.h) and prepared, or twice in a batch for
// compute shaders, whichever is more.
constexpr uint64_t kWaitingSplatBytes =
    sizeof(uint64_t) +
    std::max<uint64_t>(sizeof(ScreenSplat) + PaintResources::kPreparedBytesASplat, 2 * sizeof(ScreenSplat));
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
    throw TooLittleMemory(
        fmt::format("--memory {}: too little for {}x{} pixels of this cache; give at least {} MiB",
                    byteText(memory_bytes), fixed.size.width, fixed.size.height, (least >> 20) + 1),
        fixed.size, least);
  const uint64_t part = memory_bytes / kParts;
  const uint64_t rounded = (exact + part - 1) / part * part;
  const unsigned wanted = threadsOrCores(threads);
  FrameBudget budget;
  const uint64_t taken = rounded + pools + wanted * worker_bytes <= memory_bytes ? rounded : exact;
  const uint64_t fit = (memory_bytes - taken - pools) / worker_bytes;
  budget.workers =
      static_cast<unsigned>(std::min<uint64_t>(wanted, std::max(std::min(fit, kFirstWorkers), fit / 2)));
  uint64_t free = memory_bytes - taken - pools - budget.workers * worker_bytes;
  const uint64_t waiting_bytes = std::min(free / 6, kMaxWaitingBytes);
  budget.waiting_splats += waiting_bytes / kWaitingSplatBytes;
  free -= waiting_bytes;
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
  // In a series, values of three steps are kept for each brick: those of the step, and of the two that it is
  // predicted from.
  budget.kept_bytes = fixed.is_series ? rest * kKeptArrays / (kArraysOfSplats + kKeptArrays) : 0;
  budget.cache_bytes = rest - budget.kept_bytes;
  return budget;
}

namespace {

constexpr uint32_t kNumbers[] = {1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, kMaxRegions};
// The share of the sweep's memory that a layer may fill, by the estimate: pages are not full, and parts are
// swept ahead.
constexpr double kLayerShare = 0.7;
// The share of it that a slab fills, on average, where the layer does not fit.
constexpr double kSlabShare = 0.6;
// The wait of threads for one another between regions: as long as preparing this number of splats takes.
constexpr double kSplatsARegion = 100e3;
// The size of a sample of parts that stands for all of them, if there are more. The choice only changes how
// the work is divided, and of a million parts it would take seconds.
constexpr size_t kSampledParts = size_t{1} << 15;
// Shared tiles: regions are made of whole painters' tiles, as far as those are this rank's.
constexpr int kUnit = kTileSide / kSharedTileSide;

/// [region] its box of tiles.
std::vector<TileBox> boxesOf(const std::vector<uint32_t>& owners, ImageSize size, uint32_t regions) {
  const int columns = TileSet::tilesAlong(size.width, kSharedTileSide),
            rows = TileSet::tilesAlong(size.height, kSharedTileSide);
  std::vector<TileBox> boxes(regions, {columns, rows, 0, 0});
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const uint32_t owner = owners[static_cast<size_t>(y * columns + x)];
      if (owner == kNobody) continue;
      TileBox& box = boxes[owner];
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1), std::max(box.y1, y + 1)};
    }
  return boxes;
}

/// How much of from .. to lies in tiles first .. last - 1; of a point: 1 or 0.
double partWithin(float from, float to, int first, int last) {
  const double low = std::max<double>(from, first * kSharedTileSide),
               high = std::min<double>(to, last * kSharedTileSide);
  if (!(high >= low)) return 0;
  return to > from && std::isfinite(to - from) ? (high - low) / (double{to} - from) : 1;
}

/// The work of drawing a region with such a layer, in splats to be prepared.
double workOf(const std::vector<PartInRegion>& parts, double layer, double sweep_splats) {
  double all = 0, seen = 0, depth_first = std::numeric_limits<double>::infinity(), depth_last = 0;
  for (const PartInRegion& part : parts) {
    all += part.prepare;
    seen += part.splats;
    depth_first = std::min<double>(depth_first, part.keys.first);
    depth_last = std::max<double>(depth_last, part.keys.last);
  }
  if (layer <= kLayerShare * sweep_splats || depth_last <= depth_first) return all + kSplatsARegion;
  const double slabs = std::max(2.0, seen / (kSlabShare * sweep_splats));
  double work = kSplatsARegion * slabs;
  for (const PartInRegion& part : parts)
    work += part.prepare * (1 + (slabs - 1) * static_cast<double>(part.keys.last - part.keys.first) /
                                    (depth_last - depth_first));
  return work;
}

/// Every `stride`-th part, which costs as much as all that it stands for.
std::vector<PartCost> sampleOf(const std::vector<PartCost>& parts, size_t stride) {
  if (stride == 1) return parts;
  std::vector<PartCost> sample;
  sample.reserve(parts.size() / stride + 1);
  const auto weight = static_cast<double>(stride);
  for (size_t n = 0; n < parts.size(); n += stride) {
    PartCost part = parts[n];
    part.prepare *= weight;
    part.paint *= weight;
    part.splats *= weight;
    part.sort *= weight;
    sample.push_back(part);
  }
  return sample;
}

}  // namespace

double largestLayer(const std::vector<PartInRegion>& parts) {
  // The splats behind a key are, of all parts that it lies in: rate (last - key).
  struct Entered {
    double last, rate;
    bool operator<(const Entered& other) const { return last > other.last; }  // the first to end is on top
  };
  std::priority_queue<Entered> entered;
  double rate = 0, rate_last = 0, largest = 0;
  for (const PartInRegion& part : parts) {
    const double key = part.keys.first;
    while (!entered.empty() && entered.top().last <= key) {
      rate -= entered.top().rate;
      rate_last -= entered.top().rate * entered.top().last;
      entered.pop();
    }
    const double last = part.keys.last + 1.0;
    const double of_part = part.splats / (last - key);
    entered.push({last, of_part});
    rate += of_part;
    rate_last += of_part * last;
    largest = std::max(largest, rate_last - rate * key);
  }
  return largest;
}

std::vector<FrameRegion> frameRegions(const FramePlan& plan, const CacheReader& cache, size_t variable,
                                      size_t sweep_splats, uint32_t least_regions) {
  const auto capacity = static_cast<double>(sweep_splats);
  if (least_regions == 1 && static_cast<double>(plan.cut.splats) <= kLayerShare * capacity)
    return {{plan.tiles, {}}};
  const ImageSize size = plan.settings.view.size;
  const std::vector<PartCost> costs =
      partCosts(plan.parts, cache.bricks(), cache.brickVariables(variable), plan.settings.view);
  const TileBox all = plan.tiles ? plan.tiles->box()
                                 : TileBox{0, 0, TileSet::tilesAlong(size.width, kSharedTileSide),
                                           TileSet::tilesAlong(size.height, kSharedTileSide)};
  const size_t stride = std::max<size_t>(1, costs.size() / kSampledParts);
  const std::vector<PartCost> sample = sampleOf(costs, stride);
  const auto partsIn = [&](const TileBox& box) {
    std::vector<PartInRegion> parts;
    for (size_t n = 0; n < sample.size(); ++n) {
      const PartCost& cost = sample[n];
      const double share = partWithin(cost.box.x0, cost.box.x1, box.x0, box.x1) *
                           partWithin(cost.box.y0, cost.box.y1, box.y0, box.y1);
      if (share > 0) parts.push_back({plan.parts[n * stride].keys, share * cost.prepare, cost.prepare});
    }
    return parts;
  };
  double least = std::numeric_limits<double>::infinity();
  std::vector<uint32_t> owners;
  uint32_t regions = 1;
  for (const uint32_t number : kNumbers) {
    if (number < least_regions) continue;
    if (number > std::max<size_t>(1, all.tiles() / (kUnit * kUnit))) break;
    std::vector<uint32_t> dealt = dealTiles(sample, size, {all, kUnit, true}, number);
    double work = 0;
    bool fits = true;
    for (const TileBox& box : boxesOf(dealt, size, number)) {
      const std::vector<PartInRegion> parts = partsIn(box);
      const double layer = largestLayer(parts);
      work += workOf(parts, layer, capacity);
      fits = fits && layer <= kLayerShare * capacity;
    }
    if (work < least) {
      least = work;
      owners = std::move(dealt);
      regions = number;
    }
    if (fits) break;  // more only cut more bricks
  }
  if (regions == 1) return {{plan.tiles, {}}};
  std::vector<FrameRegion> made;
  for (uint32_t region = 0; region < regions; ++region) {
    FrameRegion one{std::make_shared<TileSet>(size, owners, region), std::vector<uint8_t>(plan.parts.size())};
    if (one.tiles->box().tiles() == 0) continue;  // more regions than could be cut
    for (size_t n = 0; n < costs.size(); ++n) one.left_out[n] = !one.tiles->touches(costs[n].box);
    made.push_back(std::move(one));
  }
  return made;
}

}  // namespace curvisplat
