#include "preprocess/gather/outer_planes.h"

#include <tbb/parallel_sort.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <tuple>

namespace curvisplat {
namespace {

// Faces against each other: the cosine of their normals, and how far the centre of one is from the plane of
// the other, in the lengths of that. The sides of a sharp edge are neither.
constexpr double kOpposite = -0.98, kApart = 0.05;
constexpr size_t kMaxComparedSides = 256;  // at one number, pair by pair

glm::dvec3 vectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// The fields by which records of one number are ordered. The number of the face is not among them, since it
/// depends on memory.
template <typename Record>
auto contentOf(const Record& record) {
  return std::tie(record.touches, record.inward, record.point);
}

/// A face at one number.
struct Side {
  uint64_t face;
  OuterPlane plane;
  bool closed = false;
};

/// Whether the plane of a face of this area, with the normal `inward`, has a point in it.
bool hasInPlane(const OuterPlane& plane, double area, const glm::dvec3& point) {
  const double length = glm::length(plane.inward);
  return std::abs(glm::dot(plane.inward, point - plane.point)) <= kApart * length * std::sqrt(area);
}

/// Whether faces lie against each other, of which `inward` is one of `shares` equal parts.
bool lieAgainst(const OuterPlane& a, const OuterPlane& b, double shares) {
  const double of_a = glm::length(a.inward), of_b = glm::length(b.inward);
  return glm::dot(a.inward, b.inward) <= kOpposite * (of_a * of_b) && hasInPlane(a, shares * of_a, b.point) &&
         hasInPlane(b, shares * of_b, a.point);
}

/// Marks the sides that lie against another one; all where very many meet.
void markClosed(std::span<Side> sides) {
  if (sides.size() > kMaxComparedSides) {
    for (Side& side : sides) side.closed = true;
    return;
  }
  for (Side& a : sides)
    for (Side& b : sides) {
      if (&b == &a) break;
      constexpr double kCorners = 4;  // `inward` is one corner's share of the face
      if (lieAgainst(a.plane, b.plane, kCorners)) a.closed = b.closed = true;
    }
}

}  // namespace

bool lieAgainst(const OuterPlane& a, const OuterPlane& b) {
  return lieAgainst(a, b, 1);
}

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
          sides.push_back({records[end].face, {vectorOf(records[end].inward), vectorOf(records[end].point)}});
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
    if (!std::binary_search(closed_.begin(), closed_.end(), record.face)) return false;
    std::vector<uint64_t>& numbers = planes.at_closed_;
    if (record.touches != 0 && (numbers.empty() || numbers.back() != record.number))
      numbers.push_back(record.number);
    return true;
  });
  return planes;
}

bool OuterPlanes::OfRange::isAtClosed(uint64_t number) const {
  return std::binary_search(at_closed_.begin(), at_closed_.end(), number);
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

namespace {

constexpr uint64_t kFacesOfCell = 6;
constexpr size_t kMaxCorners = PointBorders::kMaxPlanesOfFace;  // of a polyhedron's the first

struct PlaneRecord {
  std::array<uint64_t, kMaxCorners> corners;  // those of the face, then the cell's others
  uint32_t of_face, count;
  glm::dvec3 inward, centre;
};
static_assert(sizeof(PlaneRecord) == 120);

PlaneRecord planeRecordOf(const GatheredCells& cells, const HalfFace& face) {
  PlaneRecord record{};
  const std::span<const uint64_t> corners = cells.cornersOfCell(face.cell);
  record.inward = face.inward;
  record.centre = face.centre;
  if (face.of_plain_cell) {
    uint32_t in_face = 0;  // bits of places
    for (const uint32_t place : face.corners) {
      record.corners[record.of_face++] = corners[place];
      in_face |= 1u << place;
    }
    record.count = record.of_face;
    for (size_t place = 0; place < corners.size(); ++place)
      if ((in_face >> place & 1) == 0) record.corners[record.count++] = corners[place];
    record.inward /= static_cast<double>(record.of_face);
    return record;
  }
  const auto put = [&](uint64_t corner) {
    bool known = record.count == kMaxCorners;
    for (uint32_t n = 0; n < record.count; ++n) known |= record.corners[n] == corner;
    if (!known) record.corners[record.count++] = corner;
  };
  for (const uint32_t place : face.corners) put(corners[place]);
  record.of_face = record.count;
  for (size_t n = 0; n < corners.size() && record.count < kMaxCorners; ++n) put(corners[n]);
  record.inward /= static_cast<double>(record.of_face);
  return record;
}

}  // namespace

PointBorders::PointBorders(uint64_t points, uint64_t range_points, uint64_t cells, uint64_t memory_bytes,
                           const ScratchFiles& scratch)
    : faces_(sizeof(PlaneRecord), cells * kFacesOfCell, memory_bytes / 2, scratch),
      planes_((points + range_points - 1) / range_points, range_points, memory_bytes / 2, scratch) {}

uint64_t PointBorders::waitingBytes(uint64_t cells) {
  return FaceMatcher::waitingBytes(sizeof(PlaneRecord), cells * kFacesOfCell);
}

size_t PointBorders::faceBytes() {
  return sizeof(PlaneRecord);
}

void PointBorders::add(const GatheredCells& cells) {
  list_.assign(cells);
  faces_.add(list_.corners, {[&](size_t n, std::span<std::byte> to) {
               const PlaneRecord record = planeRecordOf(cells, list_.face(cells, n));
               std::memcpy(to.data(), &record, sizeof record);
             }});
}

void PointBorders::finish(const Progress& progress) {
  list_ = {};
  uint64_t face = 0;
  faces_.finish([](std::span<const std::byte>, std::span<const std::byte>) {},
                [&](const FaceCorners&, std::span<const std::byte> bytes) {
                  PlaneRecord record;
                  std::memcpy(static_cast<void*>(&record), bytes.data(), sizeof record);
                  for (uint32_t n = 0; n < record.count; ++n)
                    planes_.add(record.corners[n], {record.inward, record.centre, n < record.of_face}, face);
                  ++face;
                },
                progress);
  faces_.forget();
  planes_.close();
  planes_.leaveOutClosed(progress);
}

}  // namespace curvisplat
