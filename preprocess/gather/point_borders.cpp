#include "preprocess/gather/point_borders.h"

#include <array>
#include <cstring>

namespace curvisplat {
namespace {

constexpr uint64_t kFacesOfCell = 6;
constexpr size_t kMaxCorners = PointBorders::kMaxPlanesOfFace;  // of a polyhedron's the first

struct FaceRecord {
  std::array<uint64_t, kMaxCorners> corners;  // those of the face, then the cell's others
  uint32_t of_face, count;
  glm::dvec3 inward, centre;
};
static_assert(sizeof(FaceRecord) == 120);

FaceRecord recordOf(const GatheredCells& cells, const HalfFace& face) {
  FaceRecord record{};
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
  for (const uint64_t corner : corners) put(corner);
  record.inward /= static_cast<double>(record.of_face);
  return record;
}

}  // namespace

PointBorders::PointBorders(uint64_t points, uint64_t range_points, uint64_t cells, uint64_t memory_bytes,
                           const ScratchFiles& scratch)
    : faces_(sizeof(FaceRecord), cells * kFacesOfCell, memory_bytes / 2, scratch),
      planes_((points + range_points - 1) / range_points, range_points, memory_bytes / 2, scratch) {}

uint64_t PointBorders::waitingBytes(uint64_t cells) {
  return FaceMatcher::waitingBytes(sizeof(FaceRecord), cells * kFacesOfCell);
}

size_t PointBorders::faceBytes() {
  return sizeof(FaceRecord);
}

void PointBorders::add(const GatheredCells& cells) {
  list_.assign(cells);
  faces_.add(list_.corners, {[&](size_t n, std::span<std::byte> to) {
               const FaceRecord record = recordOf(cells, list_.face(cells, n));
               std::memcpy(to.data(), &record, sizeof record);
             }});
}

void PointBorders::finish(const Progress& progress) {
  list_ = {};
  uint64_t face = 0;
  faces_.finish([](std::span<const std::byte>, std::span<const std::byte>) {},
                [&](std::span<const std::byte> bytes) {
                  FaceRecord record;
                  std::memcpy(static_cast<void*>(&record), bytes.data(), sizeof record);
                  for (uint32_t n = 0; n < record.count; ++n)
                    planes_.add(record.corners[n], {record.inward, record.centre, n < record.of_face}, face);
                  ++face;
                },
                progress);
  planes_.close();
  planes_.leaveOutClosed(progress);
}

}  // namespace curvisplat
