#include "render/tiles/tile_queues.h"

#include <algorithm>
#include <cmath>

#include "stream/base/trace.h"

namespace curvisplat {
namespace {

// A tile is painted when this many new splats have come, or a share of what waits: what waits is looked at each time.
constexpr size_t kWorthPainting = 192, kShareOfWaiting = 2;
// Splats that are prepared and sorted together; more would not stay in a core's cache.
constexpr size_t kRound = 512;
constexpr uint32_t kNothingLeft = UINT32_MAX;  // keys are smaller
// Of a thread: a round, the splats that wait in a tile, and what the painter prepares of them.
constexpr uint64_t kScratchBytes = 1 << 20;

/// How many records lie before a splat.
uint32_t recordsBefore(std::span<const ScreenSplat> splats, uint32_t splat) {
  uint32_t records = 0;
  while (records < splat && isRecord(splats[splat - records - 1])) ++records;
  return records;
}

struct OrderTileRange {
  int first, last;
};

/// Those along a tile that pixels from .. to may lie in, which count from the tile's edge.
OrderTileRange orderTilesAlong(float from, float to) {
  constexpr float kPerPixel = 1.0f / kOrderSide;
  if (!(to >= 0 && from <= kTileSide)) return {0, -1};
  return {static_cast<int>(std::max(from, 0.0f) * kPerPixel),
          static_cast<int>(std::min(to * kPerPixel, kOrderTilesAlong - 1.0f))};
}

}  // namespace

TileQueues::TileQueues(ImageSize size, size_t splats)
    : columns_(TileSet::tilesAlong(size.width)),
      queues_(TileSet::tilesOf(size)),
      memory_(std::make_unique_for_overwrite<ScreenSplat[]>((splats + kChunk - 1) / kChunk * kChunk)),
      next_(std::make_unique_for_overwrite<uint32_t[]>((splats + kChunk - 1) / kChunk * kChunk)),
      free_count_(0),
      chunks_((splats + kChunk - 1) / kChunk) {
  clear();
}

uint64_t TileQueues::bytes(ImageSize size, size_t splats, unsigned threads) {
  return (splats + kChunk) * (sizeof(ScreenSplat) + sizeof(uint32_t)) +
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

void TileQueues::append(Queue& queue, std::span<const ScreenSplat> splats, uint32_t next) {
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
    next_[place] = next;
    ++queue.count;
  }
}

void TileQueues::free(Queue& queue) {
  const MutexLock lock(mutex_);
  free_.insert(free_.end(), queue.chunks.begin(), queue.chunks.end());
  free_count_.store(free_.size(), std::memory_order_relaxed);
  queue.chunks.clear();
  queue.count = queue.seen = 0;
}

/// Moves what waits into the scratch memory.
void TileQueues::load(Queue& queue, Scratch& scratch) {
  for (uint32_t n = 0, records = 0; n < queue.count; ++n) {
    const size_t place = queue.chunks[n / kChunk] * kChunk + n % kChunk;
    scratch.splats.push_back(memory_[place]);
    if (isRecord(scratch.splats.back())) {
      ++records;
      continue;
    }
    scratch.active.push_back({n, records, next_[place], n < queue.seen});
    records = 0;
  }
  free(queue);
}

void TileQueues::store(Queue& queue, const Scratch& scratch) {
  for (const Active& active : scratch.active)
    append(queue, {&scratch.splats[active.splat - active.records], active.records + size_t{1}}, active.next);
  queue.seen = queue.count;
}

/// Lists what lies up to the front and has not been painted, and keeps in `active` what has more behind it.
void TileQueues::listTile(size_t number, uint32_t painted, uint32_t front, uint64_t open,
                          Scratch& scratch) const {
  const auto left = static_cast<float>(static_cast<int>(number) % columns_ * kTileSide);
  const auto top = static_cast<float>(static_cast<int>(number) / columns_ * kTileSide);
  for (OrderList& list : scratch.lists) list.clear();
  scratch.order.clear();
  scratch.by_middle.clear();
  constexpr float kMiddle = 0.5f * kTileSide;
  for (const Active& active : scratch.active) {
    const uint64_t key = keyAt(scratch.splats[active.splat], left + kMiddle, top + kMiddle);
    scratch.by_middle.push_back(key << 32 | scratch.order.size());
    scratch.order.push_back(active.splat);
  }
  // Layers have one order over all of the tile as a rule; the lists are then sorted as they are filled.
  std::sort(scratch.by_middle.begin(), scratch.by_middle.end());
  for (const uint64_t item : scratch.by_middle) {
    const auto index = static_cast<uint32_t>(item);
    Active& active = scratch.active[index];
    if (active.next <= front) active.next = listSplat({left, top}, painted, {front, open, index}, scratch);
    active.seen = true;
  }
  for (OrderList& list : scratch.lists)
    if (!std::is_sorted(list.begin(), list.end())) std::sort(list.begin(), list.end());
  std::erase_if(scratch.active, [](const Active& active) { return active.next == kNothingLeft; });
}

/// Of one splat. Returns the first key behind the front.
uint32_t TileQueues::listSplat(const Corner& corner, uint32_t painted, const Listed& listed,
                               Scratch& scratch) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  constexpr float kHalf = 0.5f * kOrderSide;
  const Active& active = scratch.active[listed.index];
  const ScreenSplat& splat = scratch.splats[active.splat];
  const float reach_x = kSupport * splat.l11;
  const float reach_y = kSupport * std::sqrt(splat.l21 * splat.l21 + splat.l22 * splat.l22);
  const OrderTileRange columns = orderTilesAlong(splat.x - reach_x - corner.x, splat.x + reach_x - corner.x);
  const OrderTileRange rows = orderTilesAlong(splat.y - reach_y - corner.y, splat.y + reach_y - corner.y);
  uint32_t next = kNothingLeft;
  for (int row = rows.first; row <= rows.last; ++row)
    for (int column = columns.first; column <= columns.last; ++column) {
      const int tile = row * kOrderTilesAlong + column;
      if (!(listed.open >> tile & 1)) continue;
      const uint32_t key = keyAt(splat, corner.x + static_cast<float>(column * kOrderSide) + kHalf,
                                 corner.y + static_cast<float>(row * kOrderSide) + kHalf);
      if (key > listed.front)
        next = std::min(next, key);
      else if (!active.seen || key > painted)
        scratch.lists[static_cast<size_t>(tile)].push_back(uint64_t{key} << 32 | listed.index);
    }
  return next;
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
  const size_t fresh = queue.count - queue.seen + entries.size();
  const bool has_space = free_count_.load(std::memory_order_relaxed) > chunks_ / 4;
  if (!added.last && has_space && fresh < std::max(kWorthPainting, queue.seen / kShareOfWaiting)) {
    for (const uint32_t n : entries) {
      const uint32_t records = recordsBefore(added.splats, n);
      append(queue, added.splats.subspan(n - records, records + size_t{1}), added.splats[n].first);
    }
    return;
  }
  Scratch& scratch = scratch_.local();
  scratch.splats.clear();
  scratch.active.clear();
  load(queue, scratch);
  size_t next = 0;
  do {
    const size_t worth = std::max(kRound, scratch.active.size() / kShareOfWaiting);
    for (size_t round = 0; round < worth && next < entries.size(); ++round, ++next) {
      const uint32_t splat = entries[next], records = recordsBefore(added.splats, splat);
      scratch.splats.insert(scratch.splats.end(), added.splats.begin() + (splat - records),
                            added.splats.begin() + splat + 1);
      scratch.active.push_back(
          {static_cast<uint32_t>(scratch.splats.size() - 1), records, added.splats[splat].first, false});
    }
    const uint32_t front = next < entries.size() ? added.splats[entries[next]].first
                           : added.last          ? UINT32_MAX
                                                 : added.front;
    listTile(number, queue.painted, front, open, scratch);
    if (!scratch.order.empty()) open = paint({scratch.splats, scratch.order, &scratch.lists});
    queue.painted = front;
  } while (next < entries.size() && open != 0);
  if (open != 0) store(queue, scratch);
}

}  // namespace curvisplat
