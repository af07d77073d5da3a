#include "preprocess/gather/hanging_faces.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>

#include "preprocess/gather/outer_planes.h"
#include "stream/base/memory.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxCompared = 256;  // at one corner, pair by pair

/// A bit for each of ±x, ±y, ±z to which a face's normal is about as near as to the nearest one. Normals that
/// lieAgainst() takes for opposite differ by 0.2 after one of them is turned round, which moves two cosines by up to
/// 0.29 against each other: they have opposite bits in common, as half of that is the margin of each.
uint8_t directionsOf(const glm::dvec3& inward) {
  constexpr double kMargin = 0.15;
  const glm::dvec3 cosines = inward / glm::length(inward), sizes = glm::abs(cosines);
  const double least = std::max({sizes.x, sizes.y, sizes.z}) - kMargin;
  unsigned bits = 0;
  for (int axis = 0; axis < 3; ++axis)
    if (sizes[axis] >= least) bits |= (cosines[axis] < 0 ? 2u : 1u) << 2 * axis;
  return static_cast<uint8_t>(bits);
}

uint8_t opposite(uint8_t directions) {
  return static_cast<uint8_t>((directions & 0x15u) << 1 | (directions & 0x2au) >> 1);
}

/// Whether one face may be a half or a quarter of the other. Faces of meshes that meet without fitting are not: each
/// ends where it is.
bool isRefined(const glm::dvec3& a, const glm::dvec3& b) {
  const double halvings = std::abs(std::log2(glm::length(a)) - std::log2(glm::length(b)));
  constexpr double kOff = 0.15;  // of each halving
  return std::abs(halvings - 1) < kOff || std::abs(halvings - 2) < 2 * kOff;
}

/// Whether the centre of the smaller face lies within the larger one, which counts as a parallelogram: faces may also
/// touch in one plane, each at an end of its own side of the mesh.
bool overlap(const HangingFaces::Face& a, const HangingFaces::Face& b) {
  const bool a_is_larger = glm::length(a.inward()) > glm::length(b.inward());
  const HangingFaces::Face &larger = a_is_larger ? a : b, &smaller = a_is_larger ? b : a;
  const glm::dvec3 normal = larger.inward(), step = smaller.centre - larger.centre;
  const glm::dvec3 first(larger.half_axes[0]), second(larger.half_axes[1]);
  return std::max(std::abs(glm::dot(glm::cross(step, second), normal)),
                  std::abs(glm::dot(glm::cross(first, step), normal))) < 0.25 * glm::dot(normal, normal);
}

bool hasArea(const HangingFaces::Face& face) {
  const double area = glm::length(face.inward());
  return area > 0 && std::isfinite(area);
}

bool doHang(const HangingFaces::Face& a, const HangingFaces::Face& b) {
  return a.cell != b.cell && isRefined(a.inward(), b.inward()) &&
         lieAgainst({a.inward(), a.centre}, {b.inward(), b.centre}) && overlap(a, b);
}

}  // namespace

std::array<glm::vec3, 2> HangingFaces::halfAxes(const std::array<glm::dvec3, 4>& corners,
                                                const glm::dvec3& inward) {
  const glm::dvec3 one = corners[2] - corners[0], other = corners[3] - corners[1];  // diagonals
  const glm::vec3 first(0.25 * (one - other)), second(0.25 * (one + other));
  if (glm::dot(glm::cross(one, other), inward) < 0) return {second, first};
  return {first, second};
}

HangingFaces::HangingFaces(size_t value_bytes, size_t ranges, const Memory& memory, ScratchFiles scratch)
    : value_bytes_(value_bytes),
      direction_bytes_(std::max<uint64_t>(1, memory.direction_bytes)),
      file_(std::move(scratch), streamsFor(ranges, memory.corner_bytes), memory.corner_bytes) {}

size_t HangingFaces::streamsFor(size_t ranges, uint64_t memory_bytes) {
  constexpr size_t kOfRange = 8;  // all faces of a range may hang: those of one stream would fill its memory
  return std::max(ranges, std::min(kOfRange * ranges, StreamsFile::mostStreams(memory_bytes)));
}

void HangingFaces::look(const Corners& corners, const Face& face) {
  if (!hasArea(face)) return;
  const uint8_t own = directionsOf(face.inward());
  directions_.resize(direction_bytes_);
  for (const uint64_t corner : corners) {
    uint8_t& directions = directionsAt(corner);
    may_hang_ |= (directions & opposite(own)) != 0;
    directions |= own;
  }
}

void HangingFaces::add(const Corners& corners, const Face& face, std::span<const std::byte> values) {
  if (!hasArea(face)) return;
  const uint8_t directions = opposite(directionsOf(face.inward()));
  record_.resize(bytesOfCorner(value_bytes_));
  std::copy(values.begin(), values.end(), record_.begin() + sizeof(Record));
  for (const uint64_t corner : corners) {
    if ((directionsAt(corner) & directions) == 0) continue;
    const Record record{corner, face};
    std::memcpy(record_.data(), &record, sizeof record);
    file_.append(corner % file_.streams(), record_);
  }
}

void HangingFaces::finish(const Take& take, const Progress& progress) {
  freeMemory(directions_);
  file_.close();
  std::vector<std::pair<uint64_t, size_t>> places;  // corners, and where their records are
  for (size_t stream = 0; stream < file_.streams(); ++stream) {
    progress.throwIfStopped();
    places.clear();
    records_.clear();
    records_.reserve(file_.bytes(stream));
    file_.forEach(stream, [&](std::span<const std::byte> records) {
      records_.insert(records_.end(), records.begin(), records.end());
    });
    file_.forget(stream);
    const size_t bytes = bytesOfCorner(value_bytes_);
    places.reserve(records_.size() / bytes);
    for (size_t at = 0; at < records_.size(); at += bytes) places.emplace_back(recordAt(at).corner, at);
    tbb::parallel_sort(places.begin(), places.end());
    for (size_t first = 0, end = 0; first < places.size(); first = end) {
      while (end < places.size() && places[end].first == places[first].first) ++end;
      pairAt(std::span(places).subspan(first, end - first), take);
    }
  }
  freeMemory(records_);
}

HangingFaces::Record HangingFaces::recordAt(size_t at) const {
  Record record;
  std::memcpy(static_cast<void*>(&record), records_.data() + at, sizeof record);
  return record;
}

void HangingFaces::pairAt(std::span<const std::pair<uint64_t, size_t>> corner, const Take& take) {
  at_corner_.clear();
  uint8_t directions = 0;
  for (const auto& [number, at] : corner) {
    at_corner_.emplace_back(recordAt(at).face,
                            std::span(records_).subspan(at + sizeof(Record), value_bytes_));
    directions |= directionsOf(at_corner_.back().first.inward());
  }
  // Faces that came for another corner of the same directionsAt() depend on memory.
  std::erase_if(at_corner_, [&](const auto& face) {
    return (directions & opposite(directionsOf(face.first.inward()))) == 0;
  });
  if (at_corner_.size() > kMaxCompared) return;
  for (size_t n = 1; n < at_corner_.size(); ++n)
    for (size_t m = 0; m < n; ++m) {
      const auto& [face, values] = at_corner_[n];
      const auto& [other, values_of_other] = at_corner_[m];
      if (!doHang(face, other)) continue;
      take(face, other, values_of_other);
      take(other, face, values);
    }
}

}  // namespace curvisplat
