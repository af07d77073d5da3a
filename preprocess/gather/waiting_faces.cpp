#include "preprocess/gather/waiting_faces.h"

#include <algorithm>

#include "preprocess/gather/face_matcher.h"
#include "preprocess/gather/point_borders.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxFollowed = uint64_t{1} << 19;

}  // namespace

WaitingFaces::WaitingFaces(uint64_t faces, uint64_t range_cells) : range_cells_(range_cells) {
  while (faces >> share_ > 2 * kMaxFollowed) ++share_;
  most_waiting_ = std::max(FaceMatcher::kMaxWaiting >> share_, uint32_t{1});
}

void WaitingFaces::add(const GatheredCells& cells) {
  list_.assign(cells);
  for (size_t n = 0; n < list_.corners.size(); ++n) {
    if (!follows(list_.corners[n][0])) continue;
    const uint32_t cell = list_.places[n].cell;
    const uint64_t corners =
        std::min<uint64_t>(cells.cornersOfCell(cell).size(), PointBorders::kMaxPlanesOfFace);
    add(list_.corners[n], cells.numbers[cell], static_cast<uint32_t>(corners));
  }
}

void WaitingFaces::add(const FaceCorners& corners, uint64_t cell, uint32_t corners_of_cell) {
  const auto same = open_.find(corners);
  if (same == open_.end()) {
    const uint32_t entry = newEntry({corners, false});
    open_[corners] = {cell, entry, corners_of_cell};
    return;
  }
  const Seen first = same->second;
  open_.erase(same);
  Counts::Pairs& pairs = first.entry == kSpilled ? counts_.found_late : counts_.found;
  ++(first.cell / range_cells_ == cell / range_cells_ ? pairs.in_range : pairs.across);
  if (first.entry == kSpilled) {
    ++counts_.spilled;
    newEntry({corners, true});
  } else {
    free_.push_back(first.entry);
  }
}

uint32_t WaitingFaces::newEntry(const Entry& entry) {
  uint32_t place = next_to_spill_;
  if (!free_.empty()) {
    place = free_.back();
    free_.pop_back();
  } else if (waiting_.size() < most_waiting_) {
    place = static_cast<uint32_t>(waiting_.size());
    waiting_.emplace_back();
  } else {
    next_to_spill_ = (next_to_spill_ + 1) % most_waiting_;
    if (!waiting_[place].is_second) {
      open_[waiting_[place].corners].entry = kSpilled;
      ++counts_.spilled;
    }
  }
  waiting_[place] = entry;
  return place;
}

WaitingFaces::Counts WaitingFaces::counts() const {
  Counts counts = counts_;
  for (const auto& [corners, seen] : open_) {
    if (seen.entry != kSpilled) ++counts.spilled;
    ++counts.outer;
    counts.corners_of_outer += seen.corners;
  }
  for (uint64_t* const count :
       {&counts.spilled, &counts.outer, &counts.corners_of_outer, &counts.found.in_range,
        &counts.found.across, &counts.found_late.in_range, &counts.found_late.across})
    *count <<= share_;
  return counts;
}

}  // namespace curvisplat
