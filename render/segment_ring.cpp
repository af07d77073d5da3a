#include "render/segment_ring.h"

#include <algorithm>

#include "stream/error.h"

namespace curvisplat {

SegmentRing::SegmentRing(size_t capacity)
    : capacity_(capacity), splats_(std::make_unique_for_overwrite<ScreenSplat[]>(capacity)) {}

std::optional<std::span<ScreenSplat>> SegmentRing::acquire(uint64_t sequence, size_t count) {
  CURVISPLAT_CHECK_OP(count, <=, capacity_);
  std::unique_lock lock(mutex_);
  uint64_t begin = 0;
  granted_.wait(lock, [&] {
    if (closed_) return true;
    if (sequence != first_sequence_ + segments_.size()) return false;
    const uint64_t next_lap = (end_ + capacity_ - 1) / capacity_ * capacity_;
    begin = segments_.empty() || end_ % capacity_ + count > capacity_ ? next_lap : end_;
    return segments_.empty() || begin + count - segments_.front().begin <= capacity_;
  });
  if (closed_) return {};
  segments_.push_back({begin, count, false});
  end_ = begin + count;
  peak_ = std::max(peak_, static_cast<size_t>(end_ - segments_.front().begin));
  granted_.notify_all();
  return std::span(&splats_[begin % capacity_], count);
}

void SegmentRing::commit(uint64_t sequence) {
  const std::lock_guard lock(mutex_);
  segments_[sequence - first_sequence_].committed = true;
  if (sequence == first_sequence_) committed_.notify_all();
}

std::optional<std::span<const ScreenSplat>> SegmentRing::next() {
  std::unique_lock lock(mutex_);
  committed_.wait(lock, [&] { return closed_ || (!segments_.empty() && segments_.front().committed); });
  if (closed_) return {};
  const Segment& segment = segments_.front();
  return std::span<const ScreenSplat>(&splats_[segment.begin % capacity_], segment.count);
}

void SegmentRing::release() {
  const std::lock_guard lock(mutex_);
  segments_.pop_front();
  ++first_sequence_;
  granted_.notify_all();
}

void SegmentRing::reset() {
  const std::lock_guard lock(mutex_);
  segments_.clear();
  end_ = first_sequence_ = 0;
  closed_ = false;
  peak_ = 0;
}

size_t SegmentRing::peakSplats() const {
  const std::lock_guard lock(mutex_);
  return peak_;
}

void SegmentRing::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  granted_.notify_all();
  committed_.notify_all();
}

}  // namespace curvisplat
