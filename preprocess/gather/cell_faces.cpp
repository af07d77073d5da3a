#include "preprocess/gather/cell_faces.h"

#include <tbb/blocked_range.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <glm/geometric.hpp>
#include <limits>

#include "preprocess/grid/parallel.h"

namespace curvisplat {
namespace {

constexpr size_t kCellsPerTask = 256;
constexpr FaceCorners kCollapsed{UINT64_MAX, UINT64_MAX, UINT64_MAX};

bool areDifferent(std::span<const uint64_t> corners) {
  bool any_same = false;
  for (size_t a = 1; a < corners.size(); ++a)
    for (size_t b = 0; b < a; ++b) any_same |= corners[a] == corners[b];
  return !any_same;
}

void sortPair(uint64_t& a, uint64_t& b) {
  const uint64_t lower = std::min(a, b), upper = std::max(a, b);
  a = lower;
  b = upper;
}

/// The lowest three of the three or four different corners of a plain cell's face.
FaceCorners lowestOfPlain(std::span<const uint64_t> corners, std::span<const uint32_t> face) {
  FaceCorners lowest{corners[face[0]], corners[face[1]], corners[face[2]]};
  if (face.size() > 3) {
    uint64_t last = corners[face[3]];
    for (uint64_t& corner : lowest) sortPair(corner, last);
  }
  sortPair(lowest[0], lowest[1]);
  sortPair(lowest[1], lowest[2]);
  sortPair(lowest[0], lowest[1]);
  return lowest;
}

/// The lowest three different ones.
FaceCorners lowestOf(std::span<const uint64_t> corners, std::span<const uint32_t> face) {
  FaceCorners lowest = kCollapsed;
  for (const uint32_t place : face) {
    uint64_t corner = corners[place];
    if (corner == lowest[0] || corner == lowest[1]) continue;
    for (uint64_t& at : lowest)
      if (corner < at) std::swap(corner, at);
  }
  return lowest[2] == UINT64_MAX ? kCollapsed : lowest;
}

void measure(std::span<const glm::dvec3> at, const glm::dvec3& middle, HalfFace& face) {
  const std::span<const uint32_t> corners = face.corners;
  const glm::dvec3& first = at[corners[0]];
  glm::dvec3 sum(0.0), area(0.0);
  for (size_t n = 0; n < corners.size(); ++n) {
    sum += at[corners[n]] - first;
    const uint32_t next = corners[n + 1 == corners.size() ? 0 : n + 1];
    area += glm::cross(at[corners[n]] - first, at[next] - first);
  }
  face.centre = first + sum / static_cast<double>(corners.size());
  face.inward = (glm::dot(area, middle - face.centre) < 0 ? -0.5 : 0.5) * area;
}

/// The number of faces of a cell; `own`: those of a polyhedron.
size_t countOf(CellKind shape, std::span<const uint32_t> own) {
  static constexpr std::array<size_t, 5> kFaces{0, 4, 5, 5, 6};  // [CellKind]
  if (shape != CellKind::kPolyhedron) return kFaces[static_cast<size_t>(shape)];
  size_t count = 0;
  for (size_t at = 0; at < own.size(); at += own[at] + size_t{1}) ++count;
  return count;
}

glm::dvec3 middleOf(std::span<const glm::dvec3> corners) {
  glm::dvec3 middle(0.0);
  for (const glm::dvec3& corner : corners) middle += corner;
  return middle / static_cast<double>(corners.size());
}

std::span<const uint32_t> facesOfCell(const GatheredCells& cells, size_t n) {
  return facesOf(cells.shapes[n], cells.facesOfPolyhedron(n));
}

FaceCorners lowestOf(std::span<const uint64_t> corners, std::span<const uint32_t> face, bool is_plain) {
  return is_plain ? lowestOfPlain(corners, face) : lowestOf(corners, face);
}

}  // namespace

void FaceList::assign(const GatheredCells& cells) {
  begins_.resize(cells.size() + 1);
  for (size_t n = 0; n < cells.size(); ++n)
    begins_[n + 1] = begins_[n] + countOf(cells.shapes[n], cells.facesOfPolyhedron(n));
  corners.resize(begins_.back());
  places.resize(begins_.back());
  std::atomic<bool> any_collapsed = false;
  parallelFor(tbb::blocked_range<size_t>(0, cells.size(), kCellsPerTask),
              [&](const tbb::blocked_range<size_t>& part) {
                bool collapsed = false;
                for (size_t n = part.begin(); n < part.end(); ++n) collapsed |= assignCell(cells, n);
                if (collapsed) any_collapsed = true;
              });
  if (any_collapsed) leaveOutCollapsed();
}

/// Returns whether a face is collapsed.
bool FaceList::assignCell(const GatheredCells& cells, size_t n) {
  if (cells.shapes[n] == CellKind::kNone) return false;
  const std::span<const uint64_t> of_cell = cells.cornersOfCell(n);
  const bool is_plain = cells.shapes[n] != CellKind::kPolyhedron && areDifferent(of_cell);
  const std::span<const uint32_t> faces = facesOfCell(cells, n);
  bool collapsed = false;
  size_t to = begins_[n];
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}, ++to) {
    corners[to] = lowestOf(of_cell, faces.subspan(at + 1, faces[at]), is_plain);
    places[to] = {static_cast<uint32_t>(n), static_cast<uint32_t>(at), is_plain};
    collapsed |= corners[to][2] == UINT64_MAX;
  }
  return collapsed;
}

void FaceList::leaveOutCollapsed() {
  size_t kept = 0;
  for (size_t n = 0; n < corners.size(); ++n) {
    if (corners[n][2] == UINT64_MAX) continue;
    corners[kept] = corners[n];
    places[kept++] = places[n];
  }
  corners.resize(kept);
  places.resize(kept);
}

HalfFace FaceList::face(const GatheredCells& cells, size_t n) const {
  const Place& place = places[n];
  const std::span<const uint32_t> faces = facesOfCell(cells, place.cell);
  const CellView view = cells.view(place.cell, 0);
  HalfFace face{
      place.cell, faces.subspan(place.at + size_t{1}, faces[place.at]), place.of_plain_cell, {}, {}};
  measure(view.corners, middleOf(view.corners), face);
  return face;
}

}  // namespace curvisplat
