#include "preprocess/faces/face_regions.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace curvisplat {

FaceRegions::FaceRegions(std::vector<FaceRegion> regions) : regions_(std::move(regions)) {
  std::stable_sort(regions_.begin(), regions_.end(),
                   [](const FaceRegion& a, const FaceRegion& b) { return a.face < b.face; });
}

std::span<const FaceRegion> FaceRegions::of(uint32_t face) const {
  const auto before = [](const FaceRegion& region, uint64_t number) { return region.face < number; };
  const auto first = std::lower_bound(regions_.begin(), regions_.end(), uint64_t{face}, before);
  return {first, std::lower_bound(first, regions_.end(), uint64_t{face} + 1, before)};
}

RegionRows::RegionRows(std::span<const FaceRegion> regions, const RowRange& quads)
    : regions_(regions),
      quads_(quads),
      by_first_(regions.size()),
      changes_(regions.empty() ? 0 : quads.end - quads.begin + 1),
      inside_(quads.end - quads.begin) {
  std::iota(by_first_.begin(), by_first_.end(), 0u);
  by_last_ = by_first_;
  const auto sort_by = [&](std::vector<uint32_t>& numbers, auto row_of) {
    std::sort(numbers.begin(), numbers.end(),
              [&](uint32_t a, uint32_t b) { return row_of(regions_[a]) < row_of(regions_[b]); });
  };
  sort_by(by_first_, [](const FaceRegion& region) { return region.first[1]; });
  sort_by(by_last_, [](const FaceRegion& region) { return region.last[1]; });
}

std::span<const uint8_t> RegionRows::row(uint64_t v) {
  const size_t before = begun_ + ended_;
  for (; begun_ < by_first_.size() && regions_[by_first_[begun_]].first[1] <= v; ++begun_)
    change(regions_[by_first_[begun_]], 1);
  for (; ended_ < by_last_.size() && regions_[by_last_[ended_]].last[1] <= v; ++ended_)
    change(regions_[by_last_[ended_]], -1);
  if (begun_ + ended_ == before) return inside_;
  int32_t regions = 0;
  for (size_t quad = 0; quad < inside_.size(); ++quad) {
    regions += changes_[quad];
    inside_[quad] = regions > 0;
  }
  return inside_;
}

void RegionRows::change(const FaceRegion& region, int32_t by) {
  const auto quad = [&](uint64_t node) { return std::clamp(node, quads_.begin, quads_.end) - quads_.begin; };
  changes_[quad(region.first[0])] += by;
  changes_[quad(region.last[0])] -= by;
}

}  // namespace curvisplat
