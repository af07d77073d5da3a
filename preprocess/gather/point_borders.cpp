#include "preprocess/gather/point_borders.h"

#include <array>
#include <cstring>

namespace curvisplat {
namespace {

constexpr uint64_t kFacesOfCell = 6;
constexpr size_t kMaxCorners = 8;  // of a polyhedron's the first

struct FaceRecord {
  std::array<uint64_t, kMaxCorners> corners;  // those of the face, then the cell's others
  uint32_t of_face, count;
  glm::dvec3 inward, centre;
};
static_assert(sizeof(FaceRecord) == 120);

FaceRecord recordOf(const GatheredCells& cells, const CellFace& face) {
  FaceRecord record{};
  const std::span<const uint64_t> corners = cells.cornersOfCell(face.cell);
  const auto put = [&](uint64_t corner) {
    bool known = record.count == kMaxCorners;
    for (uint32_t n = 0; n < record.count; ++n) known |= record.corners[n] == corner;
    if (!known) record.corners[record.count++] = corner;
  };
  for (const uint32_t place : face.corners) put(corners[place]);
  record.of_face = record.count;
  for (const uint64_t corner : corners) put(corner);
  record.inward = face.inward / static_cast<double>(record.of_face);
  record.centre = face.centre;
  return record;
}

}  // namespace

PointBorders::PointBorders(uint64_t points, uint64_t range_points, uint64_t cells, uint64_t memory_bytes,
                           const std::filesystem::path& folder)
    : faces_(sizeof(FaceRecord), cells * kFacesOfCell, memory_bytes / 2, folder),
      planes_((points + range_points - 1) / range_points, range_points, memory_bytes / 2, folder) {}

uint64_t PointBorders::waitingBytes(uint64_t cells) {
  return FaceMatcher::waitingBytes(sizeof(FaceRecord), cells * kFacesOfCell);
}

void PointBorders::add(const GatheredCells& cells) {
  facesOfCells(
      cells, sizeof(FaceRecord),
      [&](const CellFace& face, std::span<std::byte> to) {
        const FaceRecord record = recordOf(cells, face);
        std::memcpy(to.data(), &record, sizeof record);
      },
      records_);
  faces_.add(records_, [](std::span<const std::byte>, std::span<const std::byte>) {});
}

void PointBorders::finish(const Progress& progress) {
  records_ = {};
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
