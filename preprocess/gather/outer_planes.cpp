#include "preprocess/gather/outer_planes.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <tuple>

namespace curvisplat {
namespace {

// Faces against each other: the cosine of their normals, and how far the centre of one is from the plane of the other, in
// the lengths of that. The sides of a sharp edge are neither.
constexpr double kOpposite = -0.98, kApart = 0.05;
constexpr size_t kMaxCompared = 256;  // at one number, pair by pair

glm::dvec3 vectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// What puts records of one number into an order; the number of the face, which depends on memory, is none of it.
template <typename Record>
auto contentOf(const Record& record) {
  return std::tie(record.touches, record.inward, record.point);
}

/// A face at one number.
struct Side {
  uint64_t face;
  glm::dvec3 inward, point;
  bool closed = false;
};

/// Whether the plane of `side` has the other one's centre in it.
bool isBeside(const Side& side, const Side& other) {
  constexpr double kCorners = 4;  // `inward` is one corner's share of the face
  const double area = glm::length(side.inward);
  return std::abs(glm::dot(side.inward, other.point - side.point)) <=
         kApart * area * std::sqrt(kCorners * area);
}

/// Those that lie against another one; all where very many meet.
void markClosed(std::span<Side> sides) {
  if (sides.size() > kMaxCompared) {
    for (Side& side : sides) side.closed = true;
    return;
  }
  for (Side& a : sides)
    for (Side& b : sides) {
      if (&b == &a) break;
      const double lengths = glm::length(a.inward) * glm::length(b.inward);
      if (!(glm::dot(a.inward, b.inward) <= kOpposite * lengths)) continue;
      if (isBeside(a, b) && isBeside(b, a)) a.closed = b.closed = true;
    }
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

void OuterPlanes::leaveOutClosed(const Progress& progress) {
  std::vector<Side> sides;
  for (size_t range = 0; range < file_.streams(); ++range) {
    const OfRange planes = sorted(range);
    const auto& records = planes.records_;
    for (size_t first = 0, end = 0; first < records.size(); first = end) {
      progress.throwIfStopped();
      sides.clear();
      for (; end < records.size() && records[end].number == records[first].number; ++end)
        if (records[end].touches != 0)
          sides.push_back({records[end].face, vectorOf(records[end].inward), vectorOf(records[end].point)});
      markClosed(sides);
      for (const Side& side : sides)
        if (side.closed) closed_.push_back(side.face);
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
