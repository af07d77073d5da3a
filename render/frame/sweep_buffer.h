// Brings the splats of all bricks of a frame into one order, though no more than a layer of them is ever in
// memory: a sweep along the depth.
//
//   parts, by their nearest key      |---a---|
//                                      |-----b-----|
//                                           |--c--|
//                                                |----d----|
//   a, b, c are in:    what lies before here ----^ is final: it is sorted and drawn
//
// "Near" and "before" are meant in drawing order, whatever it is. Splats are ordered by key, then by brick,
// then by their number in the brick (SweepPosition): no two are equal, and the order depends on the cache and
// the view alone.
//
// A worker enters each part as a run, sorted, when it is that part's turn. What is final leaves in batches,
// which workers sort and hand on. Where a layer is larger than the buffer, the sweep is made in several slabs:
// the slab under way gets an end, and of as many runs as need be, those with most splats behind it first,
// what lies there is forgotten; these parts are entered again in the next slab. Should that not do, the end
// moves nearer. Slabs do not change the order, and any buffer of a few pages will do.
//
//   worker   awaitTurn(n) -> enter() -> fill()          leave its part out: awaitTurn(n) -> skip()
//                      ^       | no space
//                      |       v
//                      +- nextFinal() -> a batch to be sorted, or awaitSpace()
//            next() -> a batch: awaitFilled(), read, giveBack()
//
// No deadlock: whoever fills a run or sorts a batch waits for no turn and no space. Whoever has the turn waits
// for such workers only; if there are none, it makes space: by a batch of what is final, or by forgetting.
//
// Splats lie in pages, which return when all that is in them has been read or forgotten.
#pragma once

#include <compare>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "render/project/depth_keys.h"
#include "render/project/depth_sort.h"
#include "render/project/screen_splat.h"

namespace curvisplat {

/// Where a splat stands in the drawing order of a frame.
struct SweepPosition {
  uint32_t key = 0;
  uint32_t rank = 0;   // of its brick among equal keys
  uint32_t place = 0;  // in its brick, sorted
  auto operator<=>(const SweepPosition&) const = default;
};
inline constexpr SweepPosition kSweepEnd{~uint32_t{0}, ~uint32_t{0}, ~uint32_t{0}};

/// A part in the order in which the sweep takes them: by the first key, then by rank.
struct SweptPart {
  BrickPart part;
  uint32_t rank = 0;
  KeyRange keys;

  SweepPosition begin() const { return {keys.first, rank, 0}; }
  SweepPosition end() const { return {keys.last, rank, ~uint32_t{0}}; }
};

class SweepBuffer {
 public:
  static constexpr size_t kPageSplats = 256;
  static constexpr size_t kMaxBatch = 65536;
  /// What a buffer for so many splats takes.
  static constexpr uint64_t bytes(uint64_t splats) {
    return splats * (sizeof(ScreenSplat) + sizeof(uint32_t)) + splats / kPageSplats * 32;
  }

  /// For so many splats, in whole pages: a few at least. Batches have up to `batch_splats`.
  SweepBuffer(size_t splats, size_t batch_splats);

  /// The splats of one part, from the slab's begin on: all of them, or those before the slab's end.
  class Run;
  struct Piece {
    std::shared_ptr<Run> run;
    size_t from, to;
  };
  /// Splats that come next in the drawing order, in pieces by rank, each sorted.
  struct Batch {
    uint64_t sequence = 0;  // in the frame
    size_t count = 0;
    std::vector<Piece> pieces;
  };

  /// Begins a frame: empty and open. Nobody may use the buffer meanwhile; the same goes for beginSlab().
  void beginFrame();
  /// Begins the next slab, the first from the beginning on. False if the last has reached the end. `swept` is
  /// borrowed, and the same throughout the frame.
  bool beginSlab(std::span<const SweptPart> swept);
  /// The parts that are to be entered, as places in `swept`: the n-th has its turn as number n.
  const std::vector<uint32_t>& parts() const { return parts_; }

  /// Whether a part lies behind the slab. It may come to.
  bool isBehind(const SweptPart& part) const;

  /// Waits for the `sequence`-th part's turn. False if closed.
  bool awaitTurn(uint64_t sequence);
  /// Ends the turn without a splat.
  void skip();
  /// Enters a part's splats, sorted, and ends its turn; null where they find no space. The run is to be
  /// filled.
  std::shared_ptr<Run> enter(uint32_t rank, std::span<const DepthItem> sorted);
  /// In a turn that found no space and no batch: waits for some, or makes it. False if closed.
  bool awaitSpace(uint32_t rank, std::span<const DepthItem> sorted);
  /// Copies the splats of a run, as sorted, from where their items say.
  void fill(Run& run, std::span<const DepthItem> sorted, std::span<const ScreenSplat> splats);

  /// A batch of what is final, if there is one that is worth it. The caller sorts it and gives it back.
  std::optional<Batch> next();
  /// As next(); waits for one for as long as one may still come in this slab.
  std::optional<Batch> awaitNext();
  /// Any splats that are final, in a turn that finds no space: nothing while other batches are under way.
  std::optional<Batch> nextFinal();
  /// Until every run in it is filled. False if closed.
  bool awaitFilled(const Batch& batch);
  /// The keys of a batch's splats, for copy().
  void itemsOf(const Batch& batch, std::span<DepthItem> items) const;
  void copy(std::span<const DepthItem> items, std::span<ScreenSplat> to) const;
  void giveBack(const Batch& batch);

  /// Of the frame, so far: batches that were handed out. Once awaitNext() has given nothing, all there are.
  uint64_t batches() const;
  /// Slabs that were begun in this frame.
  uint64_t slabs() const { return slabs_; }
  size_t peakSplats() const;

  /// Wakes all who wait; nothing is granted until the next frame.
  void close();

 private:
  size_t pages() const { return left_.size(); }
  size_t used() const { return pages() - free_.size(); }
  SweepPosition position(const Run& run, size_t n) const;
  size_t firstNotBefore(const Run& run, const SweepPosition& mark) const;
  size_t countFinals();
  std::optional<Batch> cut(size_t at_least);
  void splitFinals(size_t finals);
  void endTurn();
  void makeSpace(uint32_t rank, std::span<const DepthItem> sorted);
  SweepPosition pageStart(size_t eighths, uint32_t rank, std::span<const DepthItem> sorted) const;
  void forgetBehindEnd(Run& run);
  void release(const Run& run, size_t from, size_t to);
  /// Nobody but whoever has the turn can make space now.
  bool isQuiet() const { return under_way_ == 0 && filling_ == 0; }

  const size_t batch_splats_;
  std::unique_ptr<ScreenSplat[]> splats_;
  std::unique_ptr<uint32_t[]> keys_;

  mutable std::mutex mutex_;         // guards all below, and keys_; splats are their run's until it is filled
  std::condition_variable changed_;  // anything that someone waits for
  std::vector<uint16_t> left_;       // [page] splats that are still to be read
  std::vector<uint32_t> free_;       // pages
  std::span<const SweptPart> swept_;
  std::vector<uint32_t> parts_;
  std::vector<uint8_t> entered_whole_;  // [swept] nothing of it is to be entered any more
  uint64_t turn_ = 0;
  SweepPosition begin_, end_;               // of the slab
  SweepPosition mark_;                      // all before it is final
  std::vector<std::shared_ptr<Run>> live_;  // with splats that are in no batch; by rank
  std::deque<SweepPosition> splits_;        // between batches of what is known to be final
  size_t entered_ = 0;                      // splats since finals were counted
  bool worth_counting_ = false;
  uint64_t batches_ = 0;    // handed out in this frame
  uint64_t under_way_ = 0;  // and not given back
  uint64_t filling_ = 0;    // runs
  uint64_t slabs_ = 0;
  size_t peak_pages_ = 0;
  bool closed_ = false;
};

/// Splats 0 to `count` - 1, by position, of which those before `first` are in batches.
class SweepBuffer::Run {
 private:
  friend class SweepBuffer;

  size_t slot(size_t n) const { return size_t{pages[n / kPageSplats]} * kPageSplats + n % kPageSplats; }

  uint32_t part = 0;  // in the frame
  uint32_t rank = 0;
  uint32_t before = 0;  // splats of the part that lie before the slab
  size_t first = 0, count = 0;
  size_t final_to = 0;  // when finals were counted
  std::vector<uint32_t> pages;
  bool filled = false;
};

}  // namespace curvisplat
