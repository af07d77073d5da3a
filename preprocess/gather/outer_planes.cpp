#include "preprocess/gather/outer_planes.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>

namespace curvisplat {

void OuterPlanes::add(uint64_t number, const OuterPlane& plane) {
  const double area = glm::length(plane.inward);
  if (!(area > 0 && std::isfinite(area))) return;
  const auto array = [](const glm::dvec3& v) { return std::array{v.x, v.y, v.z}; };
  file_.appendRecord(number / range_size_,
                     OfRange::Record{number, plane.touches, array(plane.inward), array(plane.point)});
}

OuterPlanes::OfRange OuterPlanes::load(size_t range) {
  OfRange planes;
  planes.records_.resize(file_.bytes(range) / sizeof(OfRange::Record));
  size_t at = 0;
  file_.forEach(range, [&](std::span<const std::byte> records) {
    std::memcpy(static_cast<void*>(planes.records_.data() + at), records.data(), records.size());
    at += records.size() / sizeof(OfRange::Record);
  });
  file_.forget(range);
  tbb::parallel_sort(
      planes.records_.begin(), planes.records_.end(), [](const OfRange::Record& a, const OfRange::Record& b) {
        return a.number != b.number ? a.number < b.number : std::memcmp(&a, &b, sizeof(OfRange::Record)) < 0;
      });
  return planes;
}

std::span<const OuterPlane> OuterPlanes::OfRange::of(uint64_t number,
                                                     std::vector<OuterPlane>& scratch) const {
  const auto vector = [](const std::array<double, 3>& v) { return glm::dvec3(v[0], v[1], v[2]); };
  scratch.clear();
  if (records_.empty()) return scratch;
  auto record = std::lower_bound(records_.begin(), records_.end(), number,
                                 [](const Record& a, uint64_t wanted) { return a.number < wanted; });
  for (; record != records_.end() && record->number == number; ++record)
    scratch.push_back({vector(record->inward), vector(record->point), record->touches != 0});
  return scratch;
}

}  // namespace curvisplat
