#include "preprocess/gather/sum_pages.h"

#include <algorithm>

#include "stream/base/check.h"
#include "stream/base/freed_memory.h"
#include "stream/base/trace.h"

namespace curvisplat {

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
