#include "preprocess/gather/outer_planes.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <tuple>

namespace curvisplat {
namespace {

constexpr double kOpposite = -0.9;  // cosine

glm::dvec3 vectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// What puts records of one number into an order; the number of the face, which depends on memory, is none of it.
template <typename Record>
auto contentOf(const Record& record) {
  return std::tie(record.touches, record.inward, record.point);
}

}  // namespace

void OuterPlanes::add(uint64_t number, const OuterPlane& plane, uint64_t face) {
  const double area = glm::length(plane.inward);
  if (!(area > 0 && std::isfinite(area))) return;
  const auto array = [](const glm::dvec3& v) { return std::array{v.x, v.y, v.z}; };
  file_.appendRecord(number / range_size_,
                     OfRange::Record{number, plane.touches, face, array(plane.inward), array(plane.point)});
}

OuterPlanes::OfRange OuterPlanes::sorted(size_t range) const {
  OfRange planes;
  planes.records_.resize(file_.bytes(range) / sizeof(OfRange::Record));
  size_t at = 0;
  file_.forEach(range, [&](std::span<const std::byte> records) {
    std::memcpy(static_cast<void*>(planes.records_.data() + at), records.data(), records.size());
    at += records.size() / sizeof(OfRange::Record);
  });
  tbb::parallel_sort(planes.records_.begin(), planes.records_.end(),
                     [](const OfRange::Record& a, const OfRange::Record& b) {
                       return a.number != b.number ? a.number < b.number : contentOf(a) < contentOf(b);
                     });
  return planes;
}

void OuterPlanes::leaveOutClosed() {
  for (size_t range = 0; range < file_.streams(); ++range) {
    const OfRange planes = sorted(range);
    const auto& records = planes.records_;
    for (size_t first = 0, end = 0; first < records.size(); first = end) {
      while (end < records.size() && records[end].number == records[first].number) ++end;
      for (size_t a = first; a < end; ++a)
        for (size_t b = a + 1; b < end; ++b) {
          if (records[a].touches == 0 || records[b].touches == 0) continue;
          const glm::dvec3 p = vectorOf(records[a].inward), q = vectorOf(records[b].inward);
          if (glm::dot(p, q) > kOpposite * glm::length(p) * glm::length(q)) continue;
          closed_.push_back(records[a].face);
          closed_.push_back(records[b].face);
        }
    }
    std::sort(closed_.begin(), closed_.end());
    closed_.erase(std::unique(closed_.begin(), closed_.end()), closed_.end());
  }
}

OuterPlanes::OfRange OuterPlanes::load(size_t range) {
  OfRange planes = sorted(range);
  file_.forget(range);
  std::erase_if(planes.records_, [&](const OfRange::Record& record) {
    return std::binary_search(closed_.begin(), closed_.end(), record.face);
  });
  return planes;
}

std::span<const OuterPlane> OuterPlanes::OfRange::of(uint64_t number,
                                                     std::vector<OuterPlane>& scratch) const {
  scratch.clear();
  if (records_.empty()) return scratch;
  auto record = std::lower_bound(records_.begin(), records_.end(), number,
                                 [](const Record& a, uint64_t wanted) { return a.number < wanted; });
  for (; record != records_.end() && record->number == number; ++record)
    scratch.push_back({vectorOf(record->inward), vectorOf(record->point), record->touches != 0});
  return scratch;
}

}  // namespace curvisplat
