// How a batch of splats goes to tiles, and tiles to threads: PaintLoop runs a painter's loops, and SplatBins
// lists for every tile the splats of a batch that touch it.
//
// The lists have the batch's order, and depend on nothing but the batch and the tiles that are closed: the
// same for any threads. All memory is taken when the bins are made: 52 bytes a splat, 4 an entry, 4 a tile
// and piece. One thread at a time may use either; they work on that thread and on TBB's.
#pragma once

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/camera/camera.h"
#include "render/project/screen_splat.h"
#include "stream/base/compute_permits.h"
#include "stream/base/trace.h"

namespace curvisplat {

/// A painter's loops: on the calling thread and on TBB's, as many at a time as there are permits to compute.
///
/// Each thread that gets a permit takes a few neighbours at a time until none is left, and gives way to
/// urgent threads in between. The loop ends when the last job has ended, and does not wait for threads that
/// have no permit then.
class PaintLoop {
 public:
  /// `permits` outlives the loop; null: there is no bound but `threads`.
  PaintLoop(unsigned threads, ComputePermits* permits)
      : threads_(threads),
        permits_(permits),
        // TBB warns of more than there are cores.
        arena_(std::min(static_cast<int>(threads), tbb::info::default_concurrency())) {}

  unsigned threads() const { return threads_; }
  ComputePermits* permits() const { return permits_; }

  /// job(n), for all n below `count`, `neighbours` of them one after the other. `name`: of these in the
  /// trace. Rethrows what a job throws. One caller at a time.
  template <typename Job>
  void forAll(const char* name, size_t count, size_t neighbours, const Job& job) {
    std::atomic<size_t> next = 0;
    const auto isTaken = [&] { return next.load(std::memory_order_relaxed) >= count; };
    const auto takeSome = [&] {
      const size_t begin = next.fetch_add(neighbours, std::memory_order_relaxed);
      if (begin >= count) return;
      const TraceScope trace(name);
      for (size_t n = begin; n < std::min(begin + neighbours, count); ++n) job(n);
    };
    const auto work = [&](unsigned) {
      while (!isTaken()) {
        const Computing computing(permits_, Urgency::kNormal, isTaken);
        if (!computing.granted()) return;
        do takeSome();
        while (!isTaken() && !(permits_ && permits_->isWantedUrgently()));
        if (permits_ && isTaken()) permits_->recheck();
      }
    };
    const GivenBackPermit given_back;  // to the threads of the loop, of which this is one
    const size_t parts = (count + neighbours - 1) / neighbours;
    if (parts <= 1 || threads_ == 1) {
      work(0);
      return;
    }
    const unsigned threads = static_cast<unsigned>(std::min<size_t>(threads_, parts));
    arena_.execute([&] { tbb::parallel_for(0u, threads, work, tbb::simple_partitioner()); });
  }

 private:
  unsigned threads_;
  ComputePermits* permits_;
  tbb::task_arena arena_;
};

/// Lists which splats of a batch touch which tiles: for every tile a list of indices, in the batch's order.
///
/// A batch is either collected, add() by add(), and then sorted, or borrowed: splats that are many enough
/// stay where they are, and nothing of the work is left to a single thread.
///
/// This is a counting sort: splats are counted tile by tile in a few pieces of the batch at a time, in
/// parallel, and each piece then writes where its counts say. The lists do not depend on how many pieces
/// there were. Tiles can be closed: they take no more, and splats that touch no other tiles are left out.
class SplatBins {
 public:
  /// Takes batches of at most `splats` splats and their records, or up to three more where the last is a
  /// splat with its records, which touch `entries` tiles in all.
  SplatBins(ImageSize size, size_t splats, size_t entries, unsigned pieces);
  static uint64_t bytes(ImageSize size, size_t splats, size_t entries, unsigned pieces);

  int columns() const { return columns_; }
  int rows() const { return rows_; }

  /// Adds what fits of `splats` behind those there are, and says how much that was, with those that were
  /// left out. Something always fits while empty(). Nearest first: a splat's records come before it, and are
  /// kept until it does; in splats() they are the elements before.
  size_t add(std::span<const ScreenSplat> splats);
  /// Whether records were added whose splat was not.
  bool awaitsSplat() const { return record_count_ > 0; }
  /// Fills the lists with what was added.
  void sort(PaintLoop& loop);

  /// Fills the lists with what fits of `splats`, which stay where they are until clear(), and says how much
  /// that was: all but records at the end, unless they are too many. Something always fits, but not of
  /// records alone. While empty() and not awaitsSplat().
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
