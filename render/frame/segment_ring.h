// The way from the workers to the painter: a ring of screen splats of fixed size.
//
// Space is granted in sequence order: a worker waits until every earlier segment has its space, so that the
// one which the painter needs next never starves behind later ones. Segments are contiguous and are drawn and
// freed in sequence order too.
//
//   worker n     acquire(sequence, count) -> fill -> commit(sequence)
//   painter      next() -> draw -> release(), or several next() before their release(): OpenGL draws later
//
// The memory is the painter's (PaintingBackend::splatMemory()): what workers write there is drawn from there.
// close() wakes everyone: nothing is granted or handed out after it.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>

#include "render/project/screen_splat.h"

namespace curvisplat {

class SegmentRing {
 public:
  /// `memory` is at least as large as the largest segment, and outlives the ring.
  explicit SegmentRing(std::span<ScreenSplat> memory) : splats_(memory) {}

  /// Space for `count` splats, which may be 0, of the segment that is `sequence` in the drawing order, from 0
  /// on. Nothing once the ring is closed. Any thread; each sequence number once, and each in time.
  std::optional<std::span<ScreenSplat>> acquire(uint64_t sequence, size_t count);
  /// The segment is filled.
  void commit(uint64_t sequence);
  /// For now there are no more than the first `segments`: the painter need not wait for more. Any number of
  /// times.
  void pauseAfter(uint64_t segments);
  /// More segments will come.
  void resume();

  /// The next segment in sequence. Nothing once the ring is closed, or where it pauses. The painter's thread.
  /// Who has not released all segments before it may wait for ever, since it may need their space.
  std::optional<std::span<const ScreenSplat>> next();
  /// The same, without waiting: nothing if it is not there yet.
  std::optional<std::span<const ScreenSplat>> nextIfReady();
  /// Gives back the first segment handed out that has not been.
  void release();

  void close();
  bool isClosed() const;
  /// Begins anew, open and empty, from sequence number 0 on. Nobody may use the ring meanwhile.
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

  bool isReady() const;
  bool isPaused() const { return first_sequence_ + handed_out_ == pause_; }
  std::span<const ScreenSplat> handOut();

  const std::span<ScreenSplat> splats_;

  mutable std::mutex mutex_;           // guards all below, not the splats
  std::condition_variable granted_;    // a segment was granted or released, or the ring closed
  std::condition_variable committed_;  // the first segment may be ready, or the ring closed
  // Positions count on for ever; modulo the capacity they are places in the ring. What does not fit before
  // the ring's end begins anew at its start.
  std::deque<Segment> segments_;  // granted and not released, in sequence
  uint64_t end_ = 0;              // of the last segment granted
  uint64_t first_sequence_ = 0;   // of segments_.front()
  uint64_t pause_ = kNoPause;     // the sequence number that will not come for now
  size_t handed_out_ = 0;         // the first so many of segments_
  bool closed_ = false;
  size_t peak_ = 0;
};

}  // namespace curvisplat
