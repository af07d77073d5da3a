#include "render/tiles/tile_queues.h"

#include <algorithm>
#include <cmath>

#include "stream/base/trace.h"

namespace curvisplat {
namespace {

// A tile is painted when this many new splats have come, or a share of what waits: what waits is looked at each time.
constexpr size_t kWorthPainting = 512, kShareOfWaiting = 1;
// Splats that are prepared and sorted together; more would not stay in a core's cache.
constexpr size_t kRound = 1024;
constexpr uint32_t kLastKey = INT32_MAX;
// Of a thread: a round, the splats that wait in a tile, and what the painter prepares of them.
constexpr uint64_t kScratchBytes = 2 << 20;

/// How many records lie before a splat.
uint32_t recordsBefore(std::span<const ScreenSplat> splats, uint32_t splat) {
  uint32_t records = 0;
  while (records < splat && isRecord(splats[splat - records - 1])) ++records;
  return records;
}

// A tile's splats come from anywhere in the batch. Inlined by force: the compiler leaves out a call that only prefetches.
constexpr size_t kAhead = 16;
[[gnu::always_inline]] inline void prefetch(const TileQueues::New& added, size_t entry) {
  if (entry >= added.entries.size()) return;
  const ScreenSplat* const splat = &added.splats[added.entries[entry]];
  __builtin_prefetch(splat);
  __builtin_prefetch(splat - 1);
}

}  // namespace

TileQueues::TileQueues(ImageSize size, size_t splats)
    : columns_(TileSet::tilesAlong(size.width)),
      queues_(TileSet::tilesOf(size)),
      memory_(std::make_unique_for_overwrite<ScreenSplat[]>((splats + kChunk - 1) / kChunk * kChunk)),
      left_(std::make_unique_for_overwrite<OrderTileMask[]>((splats + kChunk - 1) / kChunk * kChunk)),
      free_count_(0),
      chunks_((splats + kChunk - 1) / kChunk) {
  clear();
}

uint64_t TileQueues::bytes(ImageSize size, size_t splats, unsigned threads) {
  return (splats + kChunk) * (sizeof(ScreenSplat) + sizeof(OrderTileMask)) +
         TileSet::tilesOf(size) * sizeof(Queue) + threads * kScratchBytes;
}

void TileQueues::clear() {
  const MutexLock lock(mutex_);
  free_.clear();
  for (size_t chunk = chunks_; chunk-- > 0;) free_.push_back(static_cast<uint32_t>(chunk));
  free_count_ = chunks_;
  for (Queue& queue : queues_) queue = {};
  full_ = false;
}

void TileQueues::append(Queue& queue, std::span<const ScreenSplat> splats, OrderTileMask left) {
  for (const ScreenSplat& splat : splats) {
    if (queue.count == queue.chunks.size() * kChunk) {
      const MutexLock lock(mutex_);
      if (free_.empty()) {
        full_.store(true, std::memory_order_relaxed);
        return;
      }
      queue.chunks.push_back(free_.back());
      free_.pop_back();
      free_count_.store(free_.size(), std::memory_order_relaxed);
    }
    const size_t place = queue.chunks[queue.count / kChunk] * kChunk + queue.count % kChunk;
    memory_[place] = splat;
    left_[place] = left;
    ++queue.count;
  }
}

void TileQueues::free(Queue& queue) {
  const MutexLock lock(mutex_);
  free_.insert(free_.end(), queue.chunks.begin(), queue.chunks.end());
  free_count_.store(free_.size(), std::memory_order_relaxed);
  queue.chunks.clear();
  queue.count = queue.looked_at = 0;
}

TileCorner TileQueues::cornerOf(size_t number) const {
  return {static_cast<float>(static_cast<int>(number) % columns_ * kTileSide),
          static_cast<float>(static_cast<int>(number) / columns_ * kTileSide)};
}

/// Moves what waits into the scratch memory.
void TileQueues::load(Queue& queue, const TileCorner& corner, Scratch& scratch) {
  for (uint32_t n = 0, records = 0; n < queue.count; ++n) {
    const size_t place = queue.chunks[n / kChunk] * kChunk + n % kChunk;
    const ScreenSplat& splat = memory_[place];
    scratch.splats.push_back(splat);
    if (isRecord(splat)) {
      ++records;
      continue;
    }
    const OrderTileMask left = left_[place];
    scratch.active.push_back({n, records, left == kUnknown ? orderTilesOf(corner, splat) : left});
    records = 0;
  }
  free(queue);
}

void TileQueues::store(Queue& queue, const Scratch& scratch) {
  for (const Active& active : scratch.active)
    append(queue, {&scratch.splats[active.splat - active.records], active.records + size_t{1}}, active.left);
  queue.looked_at = queue.count;
}

/// Lists what lies up to the front, and keeps in `active` what has more behind it.
void TileQueues::listActive(uint32_t front, OrderTileMask open, Scratch& scratch) {
  for (Active& active : scratch.active) {
    const ScreenSplat& splat = scratch.splats[active.splat];
    active.left &= open;
    if (splat.first <= front) active.left = scratch.lists.add(splat, active.splat, active.left, front);
  }
  scratch.lists.end();
  std::erase_if(scratch.active, [](const Active& active) { return active.left == 0; });
}

void TileQueues::paint(size_t number, const New& added, uint64_t open, const Paint& paint) {
  Queue& queue = queues_[number];
  if (isFull()) return;
  const auto& entries = added.entries;
  const bool in_order = queue.count == 0 && std::none_of(entries.begin(), entries.end(),
                                                         [&](uint32_t n) { return leans(added.splats[n]); });
  if (in_order) {
    if (!entries.empty()) paint({added.splats, entries});
    return;
  }
  const size_t fresh = queue.count - queue.looked_at + entries.size();
  const bool has_space = free_count_.load(std::memory_order_relaxed) > chunks_ / 4;
  if (!added.last && has_space && fresh < std::max(kWorthPainting, queue.looked_at / kShareOfWaiting)) {
    for (size_t entry = 0; entry < entries.size(); ++entry) {
      prefetch(added, entry + kAhead);
      const uint32_t n = entries[entry];
      const uint32_t records = recordsBefore(added.splats, n);
      append(queue, added.splats.subspan(n - records, records + size_t{1}), kUnknown);
    }
    return;
  }
  Scratch& scratch = scratch_.local();
  scratch.splats.clear();
  scratch.active.clear();
  const TileCorner corner = cornerOf(number);
  load(queue, corner, scratch);
  size_t next = 0;
  do {
    const size_t worth = std::max(kRound, scratch.active.size() / kShareOfWaiting);
    for (size_t round = 0; round < worth && next < entries.size(); ++round, ++next) {
      prefetch(added, next + kAhead);
      const uint32_t splat = entries[next], records = recordsBefore(added.splats, splat);
      scratch.splats.insert(scratch.splats.end(), added.splats.begin() + (splat - records),
                            added.splats.begin() + splat + 1);
      scratch.active.push_back({static_cast<uint32_t>(scratch.splats.size() - 1), records,
                                orderTilesOf(corner, added.splats[splat])});
    }
    const uint32_t front = next < entries.size() ? added.splats[entries[next]].first
                           : added.last          ? kLastKey
                                                 : added.front;
    scratch.lists.begin(corner);
    listActive(front, open, scratch);
    if (!scratch.lists.order().empty())
      open = paint({scratch.splats, scratch.lists.order(), &scratch.lists.lists()});
  } while (next < entries.size() && open != 0);
  if (open != 0) store(queue, scratch);
}

}  // namespace curvisplat
