// A ring buffer of fixed size that carries screen splats from the workers to the painter.
//
// Space is granted in the order of the sequence numbers: a worker waits until every earlier segment has its
// space, so that later segments never take the space of the one that the painter needs next. Segments are
// contiguous, and are drawn and freed in the same order.
//
//   worker n     acquire(sequence, count) -> fill -> commit(sequence)
//   painter      next() -> draw -> release()
//
// The painter draws from where the workers write. close() wakes all waiting threads; after it nothing is granted or handed out.
// SegmentDrawer is the painter's side, on its thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "render/project/painter.h"
#include "render/project/screen_splat.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// Thread-safe, except where a function says otherwise.
class SegmentRing {
 public:
  /// `memory` must hold the largest segment, and must outlive the ring.
  explicit SegmentRing(std::span<ScreenSplat> memory) : splats_(memory) {}

  /// Waits for space for the `count` splats (0 is allowed) of segment number `sequence` in the drawing
  /// order, counted from 0. Returns nullopt once the ring is closed. Any thread. Every sequence number must
  /// be acquired, and only once.
  std::optional<std::span<ScreenSplat>> acquire(uint64_t sequence, size_t count);
  /// Whether the next segment, of `count` splats, would get its space at once. Any thread.
  bool hasSpaceFor(size_t count) const;
  /// Marks the segment as filled. Any thread.
  void commit(uint64_t sequence);
  /// Announces that no more than the first `segments` will come for now: the painter does not wait for more.
  /// May be called again.
  void pauseAfter(uint64_t segments);
  /// Ends the pause: more segments will come.
  void resume();

  /// Waits for the next segment in sequence. Returns nullopt once the ring is closed, or where it pauses.
  /// The painter's thread only. Release all earlier segments first: the next one may need their space, and
  /// the call would then wait for ever.
  std::optional<std::span<const ScreenSplat>> next();
  /// Returns the next segment without waiting: nullopt also if it is not filled yet.
  std::optional<std::span<const ScreenSplat>> nextIfReady();
  /// Releases the earliest segment that was handed out and is not released yet.
  void release();

  /// Ends the use of the ring and wakes all waiting threads. Any thread.
  void close();
  bool isClosed() const;
  /// Makes the ring open and empty, with sequence number 0 next. No thread may use the ring meanwhile.
  void reset();

  /// The most splats that were held at once, since reset().
  size_t peakSplats() const;

 private:
  static constexpr uint64_t kNoPause = ~uint64_t{0};

  struct Segment {
    uint64_t begin;  // position, see below
    size_t count;
    bool committed;
  };

  bool isReady() const REQUIRES(mutex_);
  bool isPaused() const REQUIRES(mutex_) { return first_sequence_ + handed_out_ == pause_; }
  std::span<const ScreenSplat> handOut() REQUIRES(mutex_);
  std::optional<uint64_t> placeFor(uint64_t sequence, size_t count) const REQUIRES(mutex_);

  const std::span<ScreenSplat> splats_;

  mutable Mutex mutex_;          // guards no splats
  ConditionVariable granted_;    // a segment was granted or released, or the ring closed
  ConditionVariable committed_;  // the first segment may be ready, or the ring closed
  // Positions only grow; modulo the capacity they are places in the ring. A segment that does not fit before
  // the ring's end is placed at its start.
  std::deque<Segment> segments_ GUARDED_BY(mutex_);  // granted and not released, in sequence
  uint64_t end_ GUARDED_BY(mutex_) = 0;              // of the last segment granted
  uint64_t first_sequence_ GUARDED_BY(mutex_) = 0;   // of segments_.front()
  uint64_t pause_ GUARDED_BY(mutex_) = kNoPause;     // the sequence number that will not come for now
  size_t handed_out_ GUARDED_BY(mutex_) = 0;         // how many of segments_, from the front, are handed out
  bool closed_ GUARDED_BY(mutex_) = false;
  size_t peak_ GUARDED_BY(mutex_) = 0;
};

/// Draws the segments of a SegmentRing, in sequence. Used on the painter's thread, between the painter's begin()
/// and end().
class SegmentDrawer {
 public:
  /// Adds the seconds that it waits to `waited_s`. All arguments are borrowed.
  SegmentDrawer(Painter& painter, SegmentRing& ring, double& waited_s)
      : painter_(painter), ring_(ring), waited_s_(waited_s) {}

  /// Waits for the next segment and draws it. False if the ring was closed or is paused.
  bool drawNext();

 private:
  Painter& painter_;
  SegmentRing& ring_;
  double& waited_s_;
};

}  // namespace curvisplat
