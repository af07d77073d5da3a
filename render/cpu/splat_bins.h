// Which splats of a batch touch which tiles: for every tile a list of indices, in the batch's order.
//
// A batch is either collected, add() by add(), and then sorted, or borrowed: splats that are many enough stay where
// they are, and nothing of the work is left to a single thread.
//
// A counting sort: splats are counted tile by tile in a few pieces of the batch at a time, in parallel, and
// each piece then writes where its counts say. The lists do not depend on how many pieces there were.
// Tiles can be closed: they take no more, and splats that touch no other tiles are left out.
// Takes 52 bytes a splat, 4 an entry, 4 a tile and piece, all at its construction.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/camera/camera.h"
#include "render/project/paint_loop.h"
#include "render/project/screen_splat.h"

namespace curvisplat {

class SplatBins {
 public:
  /// For batches of at most `splats` splats and their records, or up to three more where the last is a splat with
  /// its records, which touch `entries` tiles in all.
  SplatBins(ImageSize size, size_t splats, size_t entries, unsigned pieces);
  static uint64_t bytes(ImageSize size, size_t splats, size_t entries, unsigned pieces);

  int columns() const { return columns_; }
  int rows() const { return rows_; }

  /// Adds what fits of `splats` behind those there are, and says how much that was, with those that were left
  /// out. Something always fits while empty(). Nearest first: a splat's records come before it, and are kept
  /// until it does; in splats() they are the elements before.
  size_t add(std::span<const ScreenSplat> splats);
  /// Whether records were added whose splat was not.
  bool awaitsSplat() const { return record_count_ > 0; }
  /// Fills the lists with what was added.
  void sort(PaintLoop& loop);

  /// Fills the lists with what fits of `splats`, which stay where they are until clear(), and says how much that was: all
  /// but records at the end, unless they are too many. Something always fits, but not of records alone. While empty()
  /// and not awaitsSplat().
  size_t sortBorrowed(std::span<const ScreenSplat> splats, PaintLoop& loop);

  bool empty() const { return batch_.empty(); }
  std::span<const ScreenSplat> splats() const { return batch_; }
  /// [splats()] of one tile, after sort() or sortBorrowed().
  std::span<const uint32_t> tile(int number) const {
    const size_t begin = begins_[static_cast<size_t>(number)];
    return {entries_.get() + begin, begins_[static_cast<size_t>(number) + 1] - begin};
  }
  void clear();

  /// Opens all tiles. hidden() counts from here.
  void open();
  void open(int tile) { closed_[static_cast<size_t>(tile)] = false; }
  void close(int tile) { closed_[static_cast<size_t>(tile)] = true; }
  /// Splats that were left out.
  uint64_t hidden() const { return hidden_; }

 private:
  /// Tiles, the last included; empty where first > last.
  struct Tiles {
    uint16_t x0, y0, x1, y1;
    size_t count() const { return x0 > x1 || y0 > y1 ? 0 : (x1 - x0 + size_t{1}) * (y1 - y0 + size_t{1}); }
  };
  static const Tiles kNoTiles;
  Tiles tilesOf(const ScreenSplat& splat) const;
  bool allClosed(const Tiles& tiles) const;
  void push(const ScreenSplat& splat, const Tiles& tiles);
  size_t fitting() const;
  uint64_t countPiece(size_t piece, size_t begin, size_t end);
  void sumCounts();
  void writeEntries(PaintLoop& loop);
  template <typename Visit>
  void forPieces(PaintLoop& loop, const Visit& visit) const;
  template <typename Visit>
  size_t forOpenTiles(size_t n, const Visit& visit) const;

  const int columns_, rows_;
  const size_t most_splats_, most_entries_;
  const unsigned pieces_;
  std::vector<ScreenSplat> splats_;       // that were added
  std::array<ScreenSplat, 3> records_{};  // of the next splat that has some
  size_t record_count_ = 0;
  std::span<const ScreenSplat> batch_;  // splats_, or those borrowed
  std::unique_ptr<Tiles[]> tiles_;      // [batch_]
  size_t entry_count_ = 0;
  std::unique_ptr<uint32_t[]> entries_;
  std::vector<size_t> begins_;        // [tiles + 1]
  std::vector<uint32_t> piece_ends_;  // [piece][tile]: counts, then where the piece goes on writing
  std::vector<uint8_t> closed_;       // [tile]
  std::atomic<uint64_t> hidden_ = 0;
};

}  // namespace curvisplat
