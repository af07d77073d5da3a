// The way from the workers that prepare bricks to the painter: a ring of screen splats of fixed size.
//
// Space is granted in sequence order: a worker waits until every earlier brick has its space, so that the
// brick which the painter needs next never starves behind later ones. Segments are contiguous and are drawn
// and freed in sequence order too.
//
//   worker n     acquire(sequence, count) -> fill -> commit(sequence)
//   painter      next() -> draw -> release()
//
// close() wakes everyone: nothing is granted or handed out after it.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>

#include "render/projection.h"

namespace curvisplat {

class SegmentRing {
 public:
  /// `capacity` in splats, at least that of the largest segment.
  explicit SegmentRing(size_t capacity);

  /// Space for `count` splats, which may be 0, of the brick that is `sequence` in the drawing order, from 0
  /// on. Nothing once the ring is closed. Any thread; each sequence number once, and each in time.
  std::optional<std::span<ScreenSplat>> acquire(uint64_t sequence, size_t count);
  /// The segment is filled.
  void commit(uint64_t sequence);

  /// The next segment in sequence. Nothing once the ring is closed. The painter's thread.
  std::optional<std::span<const ScreenSplat>> next();
  /// Gives back what next() gave.
  void release();

  void close();
  /// Begins anew, open and empty, from sequence number 0 on. Nobody may use the ring meanwhile.
  void reset();

  /// The most splats that were held at once, since reset().
  size_t peakSplats() const;

 private:
  struct Segment {
    uint64_t begin;  // position, see below
    size_t count;
    bool committed;
  };

  const size_t capacity_;
  const std::unique_ptr<ScreenSplat[]> splats_;

  mutable std::mutex mutex_;           // guards all below, not the splats
  std::condition_variable granted_;    // a segment was granted or released, or the ring closed
  std::condition_variable committed_;  // the first segment may be ready, or the ring closed
  // Positions count on for ever; modulo the capacity they are places in the ring. What does not fit before
  // the ring's end begins anew at its start.
  std::deque<Segment> segments_;  // granted and not released, in sequence
  uint64_t end_ = 0;              // of the last segment granted
  uint64_t first_sequence_ = 0;   // of segments_.front()
  bool closed_ = false;
  size_t peak_ = 0;
};

}  // namespace curvisplat
