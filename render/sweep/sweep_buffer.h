// Brings the splats of all bricks of a frame into the order of the first key that each has in any tile, by a
// sweep along the depth; tiles then order what leans by their own keys (render/tiles). No more than a layer of
// them is in memory: those that a later brick may still precede.
//
//   parts, by their nearest key      |---a---|
//                                      |-----b-----|
//                                           |--c--|
//                                                |----d----|
//   a, b, c are in:    what lies before here ----^ is final: it is sorted and drawn
//
// Splats are ordered by key, then by brick, then by their number in the brick (SweepPosition): no two are
// equal, and the order depends only on the cache and the view.
//
// A worker enters each part as a sorted run when it is that part's turn. Splats whose order is final leave
// in batches, which workers sort and pass on. If a layer is larger than the buffer, the sweep is made in
// several slabs: the current slab gets an end, and the splats behind the end are discarded from as many runs
// as necessary, beginning with the runs that have most of them. Those parts are entered again in the next
// slab. If that does not free enough space, the end moves nearer. Slabs do not change the order, and a
// buffer of a few pages suffices.
//
//   worker   awaitTurn(n) -> enter() -> fill()          leave its part out: awaitTurn(n) -> skip()
//                      ^       | no space
//                      |       v
//                      +- nextFinal() -> a batch to be sorted, or awaitSpace()
//            next() -> a batch: awaitFilled(), read, giveBack()
//
// There is no deadlock: a worker that fills a run or sorts a batch waits neither for a turn nor for space.
// The worker that has the turn waits only for such workers; if there are none, it makes space itself, with a
// batch of final splats or by discarding.
//
// A picture can be swept region by region (render/frame/frame_memory.h): each region has a sweep of its own
// over the parts that it needs.
//
// Splats are stored in pages. A page is free again when all splats in it have been read or discarded.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/project/depth_sort.h"
#include "render/project/screen_splat.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// The place of a splat in the drawing order of a frame.
struct SweepPosition {
  uint32_t key = 0;
  uint32_t brick = 0;  // its number in the cache
  uint32_t place = 0;  // in its brick, sorted
  auto operator<=>(const SweepPosition&) const = default;
};
/// The end of the sweep: behind all splats.
inline constexpr SweepPosition kSweepEnd{~uint32_t{0}, ~uint32_t{0}, ~uint32_t{0}};

/// A part of the cut with its range of keys. The sweep takes parts by their first key, then by brick.
struct SweptPart {
  BrickPart part;
  KeyRange keys;

  SweepPosition begin() const { return {keys.first, part.brick, 0}; }
  SweepPosition end() const { return {keys.last, part.brick, ~uint32_t{0}}; }
};

/// Shared by a frame's workers. Thread-safe, except where a function says otherwise.
class SweepBuffer {
 public:
  static constexpr size_t kPageSplats = 256;
  static constexpr size_t kMaxBatch = 65536;
  /// Memory in bytes of a buffer for `splats` splats.
  static constexpr uint64_t bytes(uint64_t splats) {
    return splats * (sizeof(ScreenSplat) + sizeof(uint32_t)) + splats / kPageSplats * 32;
  }

  /// A buffer for `splats` splats, in whole pages and a few pages at least. Batches have up to
  /// `batch_splats`.
  SweepBuffer(size_t splats, size_t batch_splats);

  /// The splats of one part from the slab's beginning on: all of them, or those before the slab's end.
  class Run;
  /// Splats [from, to) of a run.
  struct Piece {
    std::shared_ptr<Run> run;
    size_t from, to;
  };
  /// Splats that come next in the drawing order, in pieces by brick, each sorted.
  struct Batch {
    uint64_t sequence = 0;  // in the frame
    uint64_t turn = 0;      // its splats were final before this part entered; for the trace
    size_t count = 0;
    std::vector<Piece> pieces;
  };

  /// Begins a frame with an empty, open buffer. No thread may use the buffer meanwhile, nor during
  /// beginSlab().
  void beginFrame();
  /// Begins the sweep of another region in the same frame, between slabs. `left_out` [swept]: 1 for the parts
  /// that it does not need.
  void beginRegion(std::span<const uint8_t> left_out);
  /// Begins the next slab; the first begins with the first part. False if the last slab has reached the end.
  /// `swept` is borrowed and must be the same throughout the frame.
  bool beginSlab(std::span<const SweptPart> swept);
  /// The parts to enter in this slab, as indices into `swept`: the n-th has turn number n.
  const std::vector<uint32_t>& parts() const { return parts_; }

  /// Whether a part lies behind the slab's end. The answer can change to true, since the end can move
  /// nearer.
  bool isBehind(const SweptPart& part) const;

  /// Waits for the turn of part number `sequence`. False if the buffer is closed.
  bool awaitTurn(uint64_t sequence);
  /// Ends the turn without entering splats.
  void skip();
  /// Enters a part's sorted splats and ends its turn. The caller must then fill() the run. Returns null, and
  /// does not end the turn, if there is no space or if the buffer is closed.
  std::shared_ptr<Run> enter(uint32_t brick, std::span<const DepthItem> sorted);
  /// Waits for space or makes it, in a turn that found neither space nor a batch. False if closed.
  bool awaitSpace(uint32_t brick, std::span<const DepthItem> sorted);
  /// Copies the splats of a run into the buffer in sorted order, from the places in `splats` that `sorted`
  /// has.
  void fill(Run& run, std::span<const DepthItem> sorted, std::span<const ScreenSplat> splats);

  /// A batch of final splats, if there are enough for a full one. The caller sorts it and calls giveBack().
  std::optional<Batch> next();
  /// Returns a batch as next() does, but waits for one as long as one can still come in this slab.
  std::optional<Batch> awaitNext();
  /// Any final splats, for a turn that finds no space; nullopt while other batches are being sorted.
  std::optional<Batch> nextFinal();
  /// Waits until every run in the batch is filled. False if closed.
  bool awaitFilled(const Batch& batch);
  /// Writes the keys of a batch's splats to `items`, which can then be sorted and passed to copy().
  void itemsOf(const Batch& batch, std::span<DepthItem> items) const;
  /// Copies the splats of `items`, as itemsOf() gives them, to `to` in the order of the items.
  void copy(std::span<const DepthItem> items, std::span<ScreenSplat> to) const;
  /// Frees the space of a batch, once its splats have been copied.
  void giveBack(const Batch& batch);

  /// The number of batches handed out in this frame so far: all of the slab's once awaitNext() returns
  /// nullopt.
  uint64_t batches() const;
  /// Slabs that were begun in this frame.
  uint64_t slabs() const;
  /// The most splats that the buffer has held in this frame, in whole pages.
  size_t peakSplats() const;

  /// Wakes all waiting threads. Nothing is granted until the next frame.
  void close();

 private:
  size_t pages() const REQUIRES(mutex_) { return left_.size(); }
  size_t used() const REQUIRES(mutex_) { return pages() - free_.size(); }
  SweepPosition position(const Run& run, size_t n) const REQUIRES(mutex_);
  size_t firstNotBefore(const Run& run, const SweepPosition& mark) const REQUIRES(mutex_);
  size_t countFinals() REQUIRES(mutex_);
  std::optional<Batch> cut(size_t at_least) REQUIRES(mutex_);
  void splitFinals(size_t finals, bool last_may_stay) REQUIRES(mutex_);
  void endTurn() REQUIRES(mutex_);
  ConditionVariable& turnOf(uint64_t sequence) { return turns_[sequence % turns_.size()]; }
  void makeSpace(uint32_t brick, std::span<const DepthItem> sorted) REQUIRES(mutex_);
  size_t pagesNeeded(uint32_t brick, std::span<const DepthItem> sorted) const REQUIRES(mutex_);
  SweepPosition pageStart(size_t eighths, uint32_t brick, std::span<const DepthItem> sorted) const
      REQUIRES(mutex_);
  void forgetBehindEnd(Run& run) REQUIRES(mutex_);
  void release(const Run& run, size_t from, size_t to) REQUIRES(mutex_);
  /// Whether only the worker that has the turn can make space now.
  bool isQuiet() const REQUIRES(mutex_) { return under_way_ == 0 && filling_ == 0; }

  const size_t batch_splats_;
  std::unique_ptr<ScreenSplat[]> splats_;
  std::unique_ptr<uint32_t[]> keys_;

  mutable Mutex mutex_;  // for writing keys_, too; splats are their run's until it is filled
  // Each thread is woken by what it waits for: with one condition for all, each step would wake every worker.
  std::array<ConditionVariable, 16> turns_;        // [turn number, modulo] that turn has come
  ConditionVariable batch_;                        // a batch may be cut, or there will be none
  ConditionVariable filled_;                       // a run is filled
  ConditionVariable space_;                        // a page is free, or nobody but who waits can free one
  std::vector<uint16_t> left_ GUARDED_BY(mutex_);  // [page] splats that are still to be read
  std::vector<uint32_t> free_ GUARDED_BY(mutex_);  // pages
  std::span<const SweptPart> swept_ GUARDED_BY(mutex_);
  std::vector<uint32_t> parts_;                            // written only by beginFrame() and beginSlab()
  std::vector<uint8_t> entered_whole_ GUARDED_BY(mutex_);  // [swept] nothing of it is to be entered any more
  uint64_t turn_ GUARDED_BY(mutex_) = 0;
  SweepPosition begin_ GUARDED_BY(mutex_), end_ GUARDED_BY(mutex_);  // of the slab
  SweepPosition mark_ GUARDED_BY(mutex_);                            // all before it is final
  std::vector<std::shared_ptr<Run>> live_ GUARDED_BY(mutex_);  // with splats that are in no batch; by brick
  std::deque<SweepPosition> splits_ GUARDED_BY(mutex_);        // between batches of what is known to be final
  uint64_t split_turn_ GUARDED_BY(mutex_) = 0;                 // when that was found
  size_t entered_ GUARDED_BY(mutex_) = 0;                      // splats since finals were counted
  bool worth_counting_ GUARDED_BY(mutex_) = false;
  uint64_t batches_ GUARDED_BY(mutex_) = 0;    // handed out in this frame
  uint64_t under_way_ GUARDED_BY(mutex_) = 0;  // and not given back
  uint64_t filling_ GUARDED_BY(mutex_) = 0;    // runs
  uint64_t slabs_ GUARDED_BY(mutex_) = 0;
  size_t peak_pages_ GUARDED_BY(mutex_) = 0;
  bool closed_ GUARDED_BY(mutex_) = false;
};

/// Splats 0 to `count` - 1, by position, of which those before `first` are in batches.
class SweepBuffer::Run {
 private:
  friend class SweepBuffer;

  size_t slot(size_t n) const { return size_t{pages[n / kPageSplats]} * kPageSplats + n % kPageSplats; }

  uint32_t part = 0;  // in the frame
  uint32_t brick = 0;
  uint32_t before = 0;  // splats of the part that lie before the slab
  size_t first = 0, count = 0;
  size_t final_to = 0;  // when finals were counted
  std::vector<uint32_t> pages;
  bool filled = false;
};

}  // namespace curvisplat
