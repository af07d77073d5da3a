#include "render/sweep/segment_ring.h"

#include <algorithm>
#include <optional>
#include <span>

#include "stream/base/compute_permits.h"
#include "stream/base/error.h"

namespace curvisplat {

std::optional<std::span<ScreenSplat>> SegmentRing::acquire(uint64_t sequence, size_t count) {
  const size_t capacity = splats_.size();
  CURVISPLAT_CHECK_OP(count, <=, capacity);
  MutexLock lock(mutex_);
  std::optional<uint64_t> begin;
  while (!closed_ && !(begin = placeFor(sequence, count))) granted_.wait(lock);
  if (closed_) return {};
  segments_.push_back({*begin, count, false});
  end_ = *begin + count;
  peak_ = std::max(peak_, static_cast<size_t>(end_ - segments_.front().begin));
  granted_.notify_all();
  return splats_.subspan(*begin % capacity, count);
}

/// The place where the segment would begin; nullopt if it is not its turn or there is no space.
std::optional<uint64_t> SegmentRing::placeFor(uint64_t sequence, size_t count) const {
  const size_t capacity = splats_.size();
  if (sequence != first_sequence_ + segments_.size()) return {};
  const uint64_t next_lap = (end_ + capacity - 1) / capacity * capacity;
  if (segments_.empty()) return next_lap;
  const uint64_t begin = end_ % capacity + count > capacity ? next_lap : end_;
  if (begin + count - segments_.front().begin > capacity) return {};
  return begin;
}

bool SegmentRing::hasSpaceFor(size_t count) const {
  const MutexLock lock(mutex_);
  return placeFor(first_sequence_ + segments_.size(), count).has_value();
}

void SegmentRing::commit(uint64_t sequence) {
  const MutexLock lock(mutex_);
  const size_t n = sequence - first_sequence_;
  segments_[n].committed = true;
  if (n == handed_out_) committed_.notify_all();
}

void SegmentRing::pauseAfter(uint64_t segments) {
  const MutexLock lock(mutex_);
  pause_ = segments;
  committed_.notify_all();
}

void SegmentRing::resume() {
  const MutexLock lock(mutex_);
  pause_ = kNoPause;
}

std::optional<std::span<const ScreenSplat>> SegmentRing::next() {
  MutexLock lock(mutex_);
  while (!closed_ && !isReady() && !isPaused()) committed_.wait(lock);
  if (closed_ || isPaused()) return {};
  return handOut();
}

std::optional<std::span<const ScreenSplat>> SegmentRing::nextIfReady() {
  const MutexLock lock(mutex_);
  if (closed_ || !isReady()) return {};
  return handOut();
}

bool SegmentRing::isReady() const {
  return handed_out_ < segments_.size() && segments_[handed_out_].committed;
}

std::span<const ScreenSplat> SegmentRing::handOut() {
  const Segment& segment = segments_[handed_out_++];
  return splats_.subspan(segment.begin % splats_.size(), segment.count);
}

void SegmentRing::release() {
  const MutexLock lock(mutex_);
  CURVISPLAT_CHECK_OP(handed_out_, >, 0u);
  segments_.pop_front();
  ++first_sequence_;
  --handed_out_;
  granted_.notify_all();
}

void SegmentRing::reset() {
  const MutexLock lock(mutex_);
  segments_.clear();
  handed_out_ = 0;
  end_ = first_sequence_ = 0;
  pause_ = kNoPause;
  closed_ = false;
  peak_ = 0;
}

size_t SegmentRing::peakSplats() const {
  const MutexLock lock(mutex_);
  return peak_;
}

bool SegmentRing::isClosed() const {
  const MutexLock lock(mutex_);
  return closed_;
}

void SegmentRing::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  granted_.notify_all();
  committed_.notify_all();
}

bool SegmentDrawer::drawNext() {
  std::optional<std::span<const ScreenSplat>> segment = ring_.nextIfReady();
  if (!segment) {
    const WaitTimer timer(waited_s_, "wait for splats");
    segment = ring_.next();
  }
  if (!segment) return false;
  {
    const TraceScope trace("draw batch", TraceKind::kStage);
    painter_.draw(*segment);
  }
  ring_.release();
  return true;
}

}  // namespace curvisplat
