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
constexpr size_t kPlacesOfARound = 2 * kRound;  // with records
constexpr uint32_t kLastKey = INT32_MAX;
// Each thread needs this for a round, the lists of a tile, and the least that the painter keeps of prepared splats.
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

/// Each thread has space for a round, beside what waits.
size_t TileQueues::chunksFor(size_t splats, unsigned threads) {
  return (splats + threads * kPlacesOfARound + kChunk - 1) / kChunk;
}

TileQueues::TileQueues(ImageSize size, size_t splats, unsigned threads)
    : columns_(TileSet::tilesAlong(size.width)),
      queues_(TileSet::tilesOf(size)),
      memory_(std::make_unique_for_overwrite<ScreenSplat[]>(chunksFor(splats, threads) * kChunk)),
      left_(std::make_unique_for_overwrite<OrderTileMask[]>(chunksFor(splats, threads) * kChunk)),
      free_count_(0),
      chunks_(chunksFor(splats, threads)) {
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

/// The place where the next `places` of a queue lie in one chunk: at `count`, or where the next chunk begins.
uint32_t TileQueues::nextFor(const Queue& queue, uint32_t count, uint32_t places) {
  while (count % kChunk != 0 && count % kChunk + places > kChunk)
    memory_[placeOf(queue, count++)] = ScreenCut{}.record();
  return count;
}

/// Makes space for `places` at queue.count. Whether there is memory for them.
bool TileQueues::reserve(Queue& queue, uint32_t places) {
  queue.count = nextFor(queue, queue.count, places);
  if (queue.count < queue.chunks.size() * kChunk) return true;
  const MutexLock lock(mutex_);
  if (free_.empty()) return false;
  queue.chunks.push_back(free_.back());
  free_.pop_back();
  free_count_.store(free_.size(), std::memory_order_relaxed);
  return true;
}

/// Adds a splat of the batch, with its records. Returns its place, or nothing where there is no memory.
std::optional<TileQueues::Active> TileQueues::append(Queue& queue, const New& added, uint32_t entry) {
  const uint32_t records = recordsBefore(added.splats, entry);
  if (!reserve(queue, records + 1)) return {};
  const size_t place = placeOf(queue, queue.count);
  std::copy_n(&added.splats[entry - records], records + 1, &memory_[place]);
  left_[place + records] = kUnknown;
  queue.count += records + 1;
  return Active{static_cast<uint32_t>(place + records), records, kUnknown};
}

/// Leaves the first `count` places.
void TileQueues::shorten(Queue& queue, uint32_t count) {
  queue.count = queue.looked_at = count;
  const size_t chunks = (count + kChunk - 1) / kChunk;
  if (chunks == queue.chunks.size()) return;
  const auto first = queue.chunks.begin() + static_cast<ptrdiff_t>(chunks);
  const MutexLock lock(mutex_);
  free_.insert(free_.end(), first, queue.chunks.end());
  free_count_.store(free_.size(), std::memory_order_relaxed);
  queue.chunks.erase(first, queue.chunks.end());
}

TileCorner TileQueues::cornerOf(size_t number) const {
  return {static_cast<float>(static_cast<int>(number) % columns_ * kTileSide),
          static_cast<float>(static_cast<int>(number) / columns_ * kTileSide)};
}

/// Lists what waits.
void TileQueues::list(const Queue& queue, const TileCorner& corner, std::vector<Active>& active) const {
  active.clear();
  uint32_t records = 0;
  for (uint32_t n = 0; n < queue.count; ++n) {
    if (n % kChunk == 0) records = 0;
    const size_t place = placeOf(queue, n);
    if (isRecord(memory_[place])) {
      ++records;
      continue;
    }
    const OrderTileMask left = left_[place];
    active.push_back({static_cast<uint32_t>(place), records,
                      left == kUnknown ? orderTilesOf(corner, memory_[place]) : left});
    records = 0;
  }
}

/// Leaves of the queue what is active, in the same order. Nothing moves backwards, so that it can be done in place.
void TileQueues::compact(Queue& queue, std::vector<Active>& active) {
  uint32_t count = 0;
  for (Active& splat : active) {
    const uint32_t places = splat.records + 1;
    count = nextFor(queue, count, places);
    const size_t to = placeOf(queue, count), from = splat.place - splat.records;
    if (to != from) std::copy_n(&memory_[from], places, &memory_[to]);
    splat.place = static_cast<uint32_t>(to + splat.records);
    left_[splat.place] = splat.left;
    count += places;
  }
  shorten(queue, count);
}

/// Lists what lies up to the front, and keeps in `active` what has more behind it.
void TileQueues::listActive(uint32_t front, OrderTileMask open, Scratch& scratch) const {
  for (Active& active : scratch.active) {
    const ScreenSplat& splat = memory_[active.place];
    active.left &= open;
    if (splat.first <= front) active.left = scratch.lists.add(splat, active.place, active.left, front);
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
  if (!added.last && hasSpace() && fresh < std::max(kWorthPainting, queue.looked_at / kShareOfWaiting)) {
    for (size_t entry = 0; entry < entries.size() && !isFull(); ++entry) {
      prefetch(added, entry + kAhead);
      if (!append(queue, added, entries[entry])) full_.store(true, std::memory_order_relaxed);
    }
    return;
  }
  Scratch& scratch = scratch_.local();
  const TileCorner corner = cornerOf(number);
  list(queue, corner, scratch.active);
  size_t next = 0;
  do {
    const size_t worth = std::max(kRound, scratch.active.size() / kShareOfWaiting);
    for (size_t round = 0; next < entries.size() && (round < kRound || (round < worth && hasSpace()));
         ++round, ++next) {
      prefetch(added, next + kAhead);
      auto active = append(queue, added, entries[next]);
      if (!active && round == 0) {
        full_.store(true, std::memory_order_relaxed);
        return;
      }
      if (!active) break;
      active->left = orderTilesOf(corner, added.splats[entries[next]]);
      scratch.active.push_back(*active);
    }
    const uint32_t front = next < entries.size() ? added.splats[entries[next]].first
                           : added.last          ? kLastKey
                                                 : added.front;
    scratch.lists.begin(corner);
    listActive(front, open, scratch);
    if (!scratch.lists.order().empty())
      open = paint({{memory_.get(), chunks_ * kChunk}, scratch.lists.order(), &scratch.lists.lists()});
    if (open == 0) scratch.active.clear();
    compact(queue, scratch.active);
  } while (next < entries.size() && open != 0);
}

}  // namespace curvisplat
