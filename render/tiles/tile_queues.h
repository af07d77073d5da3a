// Brings the splats of each tile into the tile's own order (tile_key.h), from batches that come in the order of
// their first keys.
//
// What a batch brings is final for a tile up to the batch's front, the first key of its last splat: no later splat
// comes before that in any tile. So a tile paints what its splats have up to the front, each of its order tiles
// sorted by itself, and keeps the splats that have something behind it: those that the front cuts through. Where all
// splats have one key in all tiles, nothing is kept and nothing sorted.
//
//   batch -> its bins (splat_bins.h) -> paint(tile): waiting + new, by rounds -> what is kept
//
// How splats were batched changes nothing, so memory and threads do not either. The splats that are kept have a fixed
// memory; where that does not suffice, isFull() says so, and the picture has to be drawn again in smaller regions.
//
// A tile that would keep one thread busy for longer than the others are can be divided into quarters, and these again:
// each part has a queue of its own, so that several threads paint the tile. A splat that touches several parts is kept
// in each, so this is left out where memory is short. No order tile's list changes.
//
// One thread a queue at a time; different queues on any threads.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"
#include "render/tiles/tile_lists.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// The splats to be painted in a tile.
struct OrderedTile {
  std::span<const ScreenSplat> splats;                        // one that is cut behind its records
  std::span<const uint32_t> order;                            // of `splats`
  const std::array<OrderList, kOrderTiles>* lists = nullptr;  // null: all of the tile in the order of `order`
};

class TileQueues {
 public:
  /// Paints, and returns which of the tile's order tiles can still change: bit n, number n.
  using Paint = std::function<uint64_t(const OrderedTile&)>;
  static constexpr uint64_t kAllOpen = ~uint64_t{0};
  static_assert(kOrderTiles <= 64);

  /// Holds at most `splats` that wait in all tiles together, records counted; `threads` paint.
  TileQueues(ImageSize size, size_t splats, unsigned threads);
  static uint64_t bytes(ImageSize size, size_t splats, unsigned threads);

  /// Nothing waits, and no tile is divided.
  void clear();

  /// The number of queues: those of all tiles, by their numbers, and behind them those of parts of tiles.
  size_t size() const { return queues_.size(); }
  size_t tileOf(size_t queue) const { return queues_[queue].tile; }
  /// The order tiles of a queue: none if it was divided.
  OrderTileMask orderTilesIn(size_t queue) const { return queues_[queue].order_tiles; }
  /// Divides a queue into those of four quarters, which are the last four from then on. Returns false, and changes
  /// nothing, if it was divided before, if it is not larger than kMinPart, if there are too many parts, if there is
  /// little memory left for what waits, or if once there was too little. No other thread may use any queue meanwhile.
  bool divide(size_t number);
  /// Moves what waits in a queue that was divided to its parts, from `first_part` on, before they are used. Different
  /// queues on any threads.
  void moveToParts(size_t number, size_t first_part);
  /// The order tiles along a side of the smallest part.
  static constexpr int kMinPart = 2;
  static constexpr size_t kParts = 4;

  struct New {
    std::span<const ScreenSplat> splats;  // of the batch
    std::span<const uint32_t> entries;    // those that touch the tile
    uint32_t front;
    bool last = false;  // no more will come for the tile: all is painted
  };
  /// Paints of a queue's order tiles what can be. `added`: of all of the tile. `open`: as `paint` returns it.
  void paint(size_t number, const New& added, uint64_t open, const Paint& paint);
  bool waits(size_t queue) const { return queues_[queue].count > 0; }
  /// An estimate of how many splats paint() would go through, with this number of entries; zero if it is not needed.
  size_t workOf(size_t number, size_t entries, bool last) const;
  bool anyWaits() const { return free_count_.load(std::memory_order_relaxed) < chunks_; }
  /// Splats had to be left out: the picture is wrong.
  bool isFull() const { return full_.load(std::memory_order_relaxed); }

 private:
  static constexpr size_t kChunk = 32;  // splats and records
  static constexpr OrderTileMask kUnknown = 0;

  /// A splat and its records lie in one chunk. What they leave of it at the end holds records of no splat.
  struct Queue {
    std::vector<uint32_t> chunks;
    uint32_t count = 0;      // places in the chunks that hold something
    uint32_t looked_at = 0;  // those that did when it was last painted
    uint32_t tile = 0;
    float share = 1;  // of the tile's entries, those that touched this part, when last looked at
    OrderTileMask order_tiles = kAllOpen;

    bool isPart() const { return order_tiles != kAllOpen; }
    void noteShare(size_t own, size_t of_tile) {
      if (isPart() && of_tile > 0) share = static_cast<float>(own) / static_cast<float>(of_tile);
    }
  };
  struct Active {
    uint32_t place;      // in memory_; its records lie before it
    uint32_t records;    // how many
    OrderTileMask left;  // where it has not been painted
  };
  struct Scratch {
    std::vector<Active> active;
    std::vector<uint32_t> order;  // of a part, where splats do not lean
    TileLists lists;
  };

  static size_t chunksFor(size_t splats, unsigned threads);
  static size_t maxParts(unsigned threads);
  TileCorner cornerOf(size_t number) const;
  static size_t chunksToMove(const Queue& queue);
  bool hasSpace() const { return free_count_.load(std::memory_order_relaxed) > chunks_ / 4; }
  /// Whether this many chunks are free, and not much less than hasSpace() asks for in addition.
  bool hasSpaceFor(size_t chunks) const {
    return free_count_.load(std::memory_order_relaxed) > chunks_ * 3 / 16 + chunks;
  }
  size_t placeOf(const Queue& queue, uint32_t n) const {
    return queue.chunks[n / kChunk] * kChunk + n % kChunk;
  }
  uint32_t nextFor(const Queue& queue, uint32_t count, uint32_t places);
  bool reserve(Queue& queue, uint32_t places);
  static bool worthPainting(const Queue& queue, size_t entries);
  std::optional<Active> append(Queue& queue, const ScreenSplat* splat, uint32_t records, OrderTileMask left);
  void defer(Queue& queue, const TileCorner& corner, const New& added);
  void paintInOrder(Queue& queue, const TileCorner& corner, const New& added, uint64_t open,
                    const Paint& paint);
  void list(const Queue& queue, const TileCorner& corner, std::vector<Active>& active) const;
  void compact(Queue& queue, std::vector<Active>& active);
  void shorten(Queue& queue, uint32_t count);
  void listActive(uint32_t front, OrderTileMask open, Scratch& scratch) const;

  const int columns_;
  const size_t tiles_, max_queues_;
  std::vector<Queue> queues_;  // [tile], then those of parts
  std::unique_ptr<ScreenSplat[]> memory_;
  // Active's, of each splat in memory_; kUnknown of those that were not looked at yet.
  std::unique_ptr<OrderTileMask[]> left_;
  Mutex mutex_;
  std::vector<uint32_t> free_ GUARDED_BY(mutex_);  // chunks
  std::atomic<size_t> free_count_;
  std::atomic<size_t> promised_ = 0;  // chunks that queues may still need which were divided, but not moved
  const size_t chunks_;
  std::atomic<bool> full_ = false;
  bool divides_ = true;
  tbb::enumerable_thread_specific<Scratch> scratch_;
};

}  // namespace curvisplat
