#include "preprocess/gather/point_pages.h"

#include <tbb/blocked_range.h>

#include <algorithm>

#include "preprocess/grid/parallel.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/trace.h"

namespace curvisplat {

PageSlots::PageSlots(uint64_t items, unsigned shift, uint64_t slots)
    : shift_(shift),
      most_(slots),
      slots_((items + (uint64_t{1} << shift) - 1) >> shift, kNone),
      used_at_(slots_.size(), 0),
      was_in_memory_(slots_.size()) {}

void PageSlots::wantPage(uint64_t page) {
  if (used_at_[page] == now_) return;
  used_at_[page] = now_;
  ++wanted_;
  if (slots_[page] == kNone) missing_.push_back(page);
}

bool PageSlots::wantsFit() {
  std::sort(missing_.begin(), missing_.end());
  return wanted_ <= most_;
}

bool PageSlots::want(std::span<const uint64_t> items) {
  ++now_;
  wanted_ = 0;
  missing_.clear();
  for (const uint64_t item : items) wantPage(item >> shift_);
  return wantsFit();
}

bool PageSlots::hold(std::span<const uint64_t> items, double most_again) {
  if (!want(items)) return false;
  uint64_t again = again_;
  for (const uint64_t page : missing_)
    if (was_in_memory_[page]) again += uint64_t{1} << shift_;
  const uint64_t held = held_ + items.size();
  if (static_cast<double>(again) > most_again * static_cast<double>(held)) return false;
  held_ = held;
  again_ = again;
  return true;
}

bool PageSlots::wantPages(uint64_t first, uint64_t end) {
  ++now_;
  wanted_ = 0;
  missing_.clear();
  for (uint64_t page = first; page < end; ++page) wantPage(page);
  return wantsFit();
}

std::span<const PageSlots::Left> PageSlots::place() {
  CURVISPLAT_CHECK_OP(wanted_, <=, most_);
  left_.clear();
  if (const uint64_t all = in_memory_.size() + missing_.size(); all > most_) {
    // Those that are wanted now were used last, and stay.
    const auto leaving = in_memory_.begin() + static_cast<ptrdiff_t>(all - most_);
    std::nth_element(in_memory_.begin(), leaving, in_memory_.end(),
                     [&](uint64_t a, uint64_t b) { return used_at_[a] < used_at_[b]; });
    for (auto page = in_memory_.begin(); page != leaving; ++page) {
      left_.push_back({*page, slots_[*page]});
      free_.push_back(slots_[*page]);
      slots_[*page] = kNone;
    }
    in_memory_.erase(in_memory_.begin(), leaving);
  }
  for (const uint64_t page : missing_) {
    if (free_.empty()) free_.push_back(slots_made_++);
    slots_[page] = free_.back();
    was_in_memory_[page] = true;
    free_.pop_back();
    in_memory_.push_back(page);
  }
  return left_;
}

void PageSlots::leave(uint64_t page) {
  if (slots_[page] == kNone) return;
  free_.push_back(slots_[page]);
  slots_[page] = kNone;
  std::erase(in_memory_, page);
}

namespace {

constexpr size_t kPointsPerTask = 4096;

}  // namespace

PointPages::PointPages(const MeshReader& reader, const PointNumbers& numbers, size_t fields,
                       uint64_t memory_bytes)
    : reader_(&reader),
      numbers_(&numbers),
      fields_(fields),
      slots_(slotsFor(reader.points(), fields, memory_bytes, numbers.merged() > 0)) {}

bool PointPages::hold(std::span<const uint64_t> points) {
  if (!slots_.hold(points, kMaxAgain)) return false;
  const std::span<const uint64_t> missing = slots_.missing();
  if (missing.empty()) return true;
  const TraceScope trace("read points");
  slots_.place();
  for (size_t first = 0; first < missing.size();) {
    size_t end = first + 1;
    while (end < missing.size() && missing[end] == missing[end - 1] + 1) ++end;
    for (size_t n = first; n < end; ++n) {
      const uint64_t page = missing[n], begin = page * kPoints;
      if (pages_.size() <= slots_.slotOf(page)) pages_.resize(slots_.slotOf(page) + size_t{1});
      Page& to = pages_[slots_.slotOf(page)];
      const uint64_t count = std::min(kPoints, reader_->points() - begin);
      to.at.resize(count);
      to.values.resize(count * fields_);
      if (numbers_->merged() == 0) continue;
      to.numbers.resize(count);
      numbers_->read(begin, to.numbers);
    }
    const uint64_t from = missing[first] * kPoints;
    const uint64_t to = std::min((missing[end - 1] + 1) * kPoints, reader_->points());
    reader_->readPoints(from, to - from, [&](const LoadedPoints& loaded) { add(loaded); });
    first = end;
  }
  return true;
}

void PointPages::add(const LoadedPoints& loaded) {
  const MeshPoints& points = loaded.points;
  parallelFor(tbb::blocked_range<size_t>(0, points.x.size(), kPointsPerTask),
              [&](const tbb::blocked_range<size_t>& part) {
                for (size_t n = part.begin(); n < part.end(); ++n) {
                  const uint64_t point = loaded.range.number + n, in_page = point & (kPoints - 1);
                  Page& page = pages_[slots_.slotOf(point >> kShift)];
                  page.at[in_page] = {points.x[n], points.y[n], points.z[n]};
                  for (size_t field = 0; field < fields_; ++field)
                    page.values[in_page * fields_ + field] = points.scalars[field][n];
                }
              });
}

SumPages::SumPages(uint64_t points, size_t values, size_t moments, uint64_t pages, ScratchFiles scratch)
    : points_(points),
      fields_(values),
      moments_(moments),
      scratch_(std::move(scratch)),
      slots_(points, kShift, pages),
      in_file_(slots_.pages()) {}

bool SumPages::hold(std::span<const uint64_t> points) {
  if (!slots_.hold(points, kMaxAgain)) return false;
  read();
  return true;
}

void SumPages::holdPages(uint64_t first, uint64_t end) {
  CURVISPLAT_CHECK(slots_.wantPages(first, std::min(end, slots_.pages())));
  read();
}

void SumPages::read() {
  const std::span<const uint64_t> missing = slots_.missing();
  if (missing.empty()) return;
  const TraceScope trace("read sums");
  for (const PageSlots::Left& left : slots_.place()) write(left.page, pages_[left.slot]);
  for (const uint64_t page : missing) {
    const uint32_t slot = slots_.slotOf(page);
    if (pages_.size() <= slot) pages_.resize(slot + size_t{1});
    Page& to = pages_[slot];
    const uint64_t count = std::min(kPoints, points_ - page * kPoints);
    to.sums.resize(count * (3 + moments_));
    to.values.resize(count * fields_);
    if (in_file_[page]) {
      const uint64_t offset = page * kPoints * bytesOfPoint(fields_, moments_);
      file_->in().readAt(offset, std::span(to.sums));
      file_->in().readAt(offset + to.sums.size() * sizeof(double), std::span(to.values));
      continue;
    }
    std::ranges::fill(to.sums, 0.0);
    for (uint64_t n = 0; n < count; ++n)
      to.sums[n * (3 + moments_)] = std::numeric_limits<double>::quiet_NaN();
  }
}

void SumPages::write(uint64_t page, const Page& from) {
  if (!file_) file_ = std::make_unique<NamelessFile>(scratch_);
  const uint64_t offset = page * kPoints * bytesOfPoint(fields_, moments_);
  file_->out().writeAt(offset, std::as_bytes(std::span(from.sums)));
  file_->out().writeAt(offset + from.sums.size() * sizeof(double), std::as_bytes(std::span(from.values)));
  in_file_[page] = true;
}

void SumPages::putAside() {
  for (uint64_t page = 0; page < slots_.pages(); ++page) {
    const uint32_t slot = slots_.slotOf(page);
    if (slot == PageSlots::kNone) continue;
    write(page, pages_[slot]);
    freeMemory(pages_[slot].sums);
    freeMemory(pages_[slot].values);
    slots_.leave(page);
  }
}

}  // namespace curvisplat
