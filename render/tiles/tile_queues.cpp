#include "render/tiles/tile_queues.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "render/project/footprint.h"
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
// There are at most this many parts of tiles for each thread, if several paint.
constexpr size_t kPartsAThread = 128;
// This many entries that are only kept cost about as much as one that is painted.
constexpr size_t kDeferredShare = 16;
// The least that all queues must hold for tiles to be divided, in splats: what is kept in several parts may not make a
// picture need more memory than it was given.
constexpr size_t kMinToDivide = size_t{1} << 18;

/// How many records lie before a splat.
uint32_t recordsBefore(std::span<const ScreenSplat> splats, uint32_t splat) {
  uint32_t records = 0;
  while (records < splat && isRecord(splats[splat - records - 1])) ++records;
  return records;
}

/// The order tiles of `tiles`, which the splat touches, in which something is left of it; the records before it say what cuts it.
OrderTileMask leftOf(const TileCorner& corner, const ScreenSplat* splat, OrderTileMask tiles) {
  if (!hasCut(*splat) || tiles == 0) return tiles;
  const ScreenSplat* const cut = SplatRecords::beside(splat, -1, isColour(splat[-1])).cut;
  return cut ? tilesLeftOf(corner, *splat, ScreenCut::of(*cut), tiles) : tiles;
}

OrderTileMask tilesOf(const TileCorner& corner, const ScreenSplat* splat) {
  return leftOf(corner, splat, orderTilesOf(corner, *splat));
}

// A tile's splats come from anywhere in the batch. Inlined by force: the compiler leaves out a call that only prefetches.
constexpr size_t kAhead = 16;
[[gnu::always_inline]] inline void prefetch(const TileQueues::New& added, size_t entry) {
  if (entry >= added.entries.size()) return;
  const ScreenSplat* const splat = &added.splats[added.entries[entry]];
  __builtin_prefetch(splat);
  __builtin_prefetch(splat - 1);
}

constexpr OrderTileMask maskOf(int column, int row, int side) {
  OrderTileMask tiles = 0;
  for (int y = row; y < row + side; ++y)
    tiles |= ((OrderTileMask{1} << side) - 1) << (y * kOrderTilesAlong + column);
  return tiles;
}

/// A square of order tiles of a tile.
struct Square {
  int column, row, side;

  static Square of(OrderTileMask tiles) {
    const int first = std::countr_zero(tiles);
    const int side = 1 << std::countr_zero(static_cast<unsigned>(std::popcount(tiles))) / 2;
    return {first % kOrderTilesAlong, first / kOrderTilesAlong, side};
  }
};

/// Finds in which order tiles of a part a splat is to be painted.
class PartFilter {
 public:
  PartFilter(const TileCorner& corner, OrderTileMask tiles) : corner_(corner), tiles_(tiles) {
    const Square square = Square::of(tiles);
    half_ = 0.5f * static_cast<float>(square.side * kOrderSide);
    x_ = corner.x + static_cast<float>(square.column * kOrderSide) + half_;
    y_ = corner.y + static_cast<float>(square.row * kOrderSide) + half_;
  }

  OrderTileMask tilesOf(const ScreenSplat& splat) const { return leftOf(corner_, &splat, touchedBy(splat)); }

 private:
  OrderTileMask touchedBy(const ScreenSplat& splat) const {
    // Most splats of a tile lie elsewhere; a rectangle around the ellipse, with a pixel's margin, says so.
    constexpr auto kSupport = static_cast<float>(kKernelSupport);
    const float reach = half_ + 1;
    if (std::abs(splat.x - x_) > reach + kSupport * splat.l11) return 0;
    if (std::abs(splat.y - y_) > reach + kSupport * (std::abs(splat.l21) + splat.l22)) return 0;
    return orderTilesOf(corner_, splat) & tiles_;
  }

  TileCorner corner_;
  OrderTileMask tiles_;
  float x_, y_, half_;  // the middle of the part, and half of its side
};

}  // namespace

/// Each thread has space for a round, beside what waits.
size_t TileQueues::chunksFor(size_t splats, unsigned threads) {
  return (splats + threads * kPlacesOfARound + kChunk - 1) / kChunk;
}

TileQueues::TileQueues(ImageSize size, size_t splats, unsigned threads)
    : columns_(TileSet::tilesAlong(size.width)),
      tiles_(TileSet::tilesOf(size)),
      max_queues_(tiles_ + maxParts(threads)),
      memory_(std::make_unique_for_overwrite<ScreenSplat[]>(chunksFor(splats, threads) * kChunk)),
      left_(std::make_unique_for_overwrite<OrderTileMask[]>(chunksFor(splats, threads) * kChunk)),
      free_count_(0),
      chunks_(chunksFor(splats, threads)) {
  queues_.reserve(max_queues_);
  clear();
}

size_t TileQueues::maxParts(unsigned threads) {
  return threads > 1 ? kPartsAThread * threads : 0;
}

uint64_t TileQueues::bytes(ImageSize size, size_t splats, unsigned threads) {
  return (splats + kChunk) * (sizeof(ScreenSplat) + sizeof(OrderTileMask)) +
         (TileSet::tilesOf(size) + maxParts(threads)) * sizeof(Queue) + threads * kScratchBytes;
}

void TileQueues::clear() {
  const MutexLock lock(mutex_);
  free_.clear();
  for (size_t chunk = chunks_; chunk-- > 0;) free_.push_back(static_cast<uint32_t>(chunk));
  free_count_ = chunks_;
  queues_.clear();
  queues_.resize(tiles_);
  for (size_t tile = 0; tile < tiles_; ++tile) queues_[tile].tile = static_cast<uint32_t>(tile);
  // Parts keep some splats twice. The picture that was too large is drawn again without them, as are all that follow.
  if (full_) divides_ = false;
  full_ = false;
  promised_ = 0;
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

/// Adds a splat, with the records before it. Returns its place, or nothing where there is no memory.
std::optional<TileQueues::Active> TileQueues::append(Queue& queue, const ScreenSplat* splat, uint32_t records,
                                                     OrderTileMask left) {
  if (!reserve(queue, records + 1)) return {};
  const size_t place = placeOf(queue, queue.count);
  std::copy_n(splat - records, records + 1, &memory_[place]);
  left_[place + records] = left;
  queue.count += records + 1;
  return Active{static_cast<uint32_t>(place + records), records, left};
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
    active.push_back(
        {static_cast<uint32_t>(place), records, left == kUnknown ? tilesOf(corner, &memory_[place]) : left});
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

/// Lists what lies up to the front, and keeps in `active` what has more behind it. The `first` of what is kept becomes about
/// the least key that it has left, so that it is not looked at again before the front is there.
void TileQueues::listActive(uint32_t front, OrderTileMask open, Scratch& scratch) const {
  for (Active& active : scratch.active) {
    ScreenSplat& splat = memory_[active.place];
    active.left &= open;
    if (splat.first <= front) active.left = scratch.lists.add(splat, active.place, active.left, front);
  }
  scratch.lists.end();
  std::erase_if(scratch.active, [](const Active& active) { return active.left == 0; });
}

/// Whether enough splats have come since it was last painted.
bool TileQueues::worthPainting(const Queue& queue, size_t entries) {
  const size_t fresh = queue.count - queue.looked_at + entries;
  return fresh >= std::max<size_t>(kWorthPainting, queue.looked_at / kShareOfWaiting);
}

size_t TileQueues::workOf(size_t number, size_t entries, bool last) const {
  const Queue& queue = queues_[number];
  if (queue.order_tiles == 0 || (entries == 0 && !(last && queue.count > 0))) return 0;
  const auto own = static_cast<size_t>(std::ceil(queue.share * static_cast<float>(entries)));
  const size_t all = queue.count + own;
  // Where nothing waits, splats may have one order, and be painted at once.
  if (last || queue.count == 0 || worthPainting(queue, own)) return 1 + all;
  // Without space queues are painted until there is some: one in two of them.
  return 1 + (hasSpace() ? own / kDeferredShare : all / 2);
}

bool TileQueues::divide(size_t number) {
  if (!divides_ || chunks_ * kChunk < kMinToDivide) return false;
  const Queue& divided = queues_[number];
  if (divided.order_tiles == 0) return false;
  const Square all = Square::of(divided.order_tiles);
  if (all.side <= kMinPart || queues_.size() + kParts > max_queues_) return false;
  const size_t needed = chunksToMove(divided);
  if (!hasSpaceFor(promised_ + needed)) return false;
  promised_ += needed;
  const int side = all.side / 2;
  for (int part = 0; part < static_cast<int>(kParts); ++part) {
    Queue& added = queues_.emplace_back();
    added.tile = queues_[number].tile;
    added.share = queues_[number].share / kParts;
    added.order_tiles = maskOf(all.column + part % 2 * side, all.row + part / 2 * side, side);
  }
  queues_[number].order_tiles = 0;
  return true;
}

/// The most chunks that moving a queue to its parts takes. Neighbouring parts keep splats that touch both: of a quarter that has
/// kMinPart order tiles along its side, half.
size_t TileQueues::chunksToMove(const Queue& queue) {
  constexpr size_t kCopies = 2;
  return kCopies * queue.chunks.size() + kParts;
}

void TileQueues::moveToParts(size_t number, size_t first_part) {
  Queue& divided = queues_[number];
  promised_ -= chunksToMove(divided);
  std::vector<Active>& active = scratch_.local().active;
  list(divided, cornerOf(divided.tile), active);
  for (size_t n = first_part; n < first_part + kParts; ++n) {
    Queue& part = queues_[n];
    for (const Active& splat : active)
      if (const OrderTileMask left = splat.left & part.order_tiles; left != 0)
        if (!append(part, &memory_[splat.place], splat.records, left))
          full_.store(true, std::memory_order_relaxed);
    part.looked_at = part.count;
  }
  shorten(divided, 0);
}

/// Keeps all for later.
void TileQueues::defer(Queue& queue, const TileCorner& corner, const New& added) {
  const PartFilter filter(corner, queue.order_tiles);
  size_t own = 0;
  for (size_t entry = 0; entry < added.entries.size() && !isFull(); ++entry) {
    prefetch(added, entry + kAhead);
    const uint32_t number = added.entries[entry];
    const ScreenSplat& splat = added.splats[number];
    const OrderTileMask left = queue.isPart() ? filter.tilesOf(splat) : kUnknown;
    if (queue.isPart() && left == 0) continue;
    ++own;
    if (!append(queue, &splat, recordsBefore(added.splats, number), left))
      full_.store(true, std::memory_order_relaxed);
  }
  queue.noteShare(own, added.entries.size());
}

/// Paints splats that do not lean, where none waits.
void TileQueues::paintInOrder(Queue& queue, const TileCorner& corner, const New& added, uint64_t open,
                              const Paint& paint) {
  if (!queue.isPart()) {
    paint({added.splats, added.entries});
    return;
  }
  const PartFilter filter(corner, queue.order_tiles);
  std::vector<uint32_t>& order = scratch_.local().order;
  order.clear();
  size_t own = 0;
  for (size_t entry = 0; entry < added.entries.size() && open != 0; ++entry) {
    prefetch(added, entry + kAhead);
    const uint32_t number = added.entries[entry];
    if (filter.tilesOf(added.splats[number]) != 0) order.push_back(number), ++own;
    if (order.size() < kRound && (entry + 1 < added.entries.size() || order.empty())) continue;
    open = paint({added.splats, order});
    order.clear();
  }
  queue.noteShare(own, added.entries.size());
}

void TileQueues::paint(size_t number, const New& added, uint64_t open, const Paint& paint) {
  Queue& queue = queues_[number];
  if (isFull()) return;
  const auto& entries = added.entries;
  const TileCorner corner = cornerOf(queue.tile);
  open &= queue.order_tiles;
  if (open == 0) {
    shorten(queue, 0);
    queue.noteShare(0, entries.size());
    return;
  }
  const bool in_order = queue.count == 0 && std::none_of(entries.begin(), entries.end(),
                                                         [&](uint32_t n) { return leans(added.splats[n]); });
  if (in_order) {
    if (!entries.empty()) paintInOrder(queue, corner, added, open, paint);
    return;
  }
  const auto expected = static_cast<size_t>(queue.share * static_cast<float>(entries.size()));
  if (!added.last && hasSpace() && !worthPainting(queue, expected)) return defer(queue, corner, added);
  Scratch& scratch = scratch_.local();
  const PartFilter filter(corner, queue.order_tiles);
  list(queue, corner, scratch.active);
  size_t next = 0, own = 0;
  do {
    const size_t worth = std::max(kRound, scratch.active.size() / kShareOfWaiting);
    for (size_t round = 0; next < entries.size() && (round < kRound || (round < worth && hasSpace()));
         ++next) {
      prefetch(added, next + kAhead);
      const ScreenSplat& splat = added.splats[entries[next]];
      const OrderTileMask left = queue.isPart() ? filter.tilesOf(splat) : tilesOf(corner, &splat);
      if (left == 0) continue;
      const auto active = append(queue, &splat, recordsBefore(added.splats, entries[next]), left);
      if (!active && round == 0) {
        full_.store(true, std::memory_order_relaxed);
        return;
      }
      if (!active) break;
      scratch.active.push_back(*active);
      ++round;
      ++own;
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
  queue.noteShare(own, next);
}

}  // namespace curvisplat
