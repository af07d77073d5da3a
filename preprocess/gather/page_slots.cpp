#include "preprocess/gather/page_slots.h"

#include <algorithm>

#include "stream/base/check.h"

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

}  // namespace curvisplat
