#include "preprocess/gather/cell_faces.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>

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
  const glm::dvec3 first = at[corners[0]];
  glm::dvec3 sum(0.0), area(0.0);
  for (size_t n = 0; n < corners.size(); ++n) {
    sum += at[corners[n]] - first;
    const uint32_t next = corners[n + 1 == corners.size() ? 0 : n + 1];
    area += glm::cross(at[corners[n]] - first, at[next] - first);
  }
  face.centre = first + sum / static_cast<double>(corners.size());
  face.inward = (glm::dot(area, middle - face.centre) < 0 ? -0.5 : 0.5) * area;
}

size_t countOf(std::span<const uint32_t> faces) {
  size_t count = 0;
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) ++count;
  return count;
}

glm::dvec3 middleOf(std::span<const glm::dvec3> corners) {
  glm::dvec3 middle(0.0);
  for (const glm::dvec3& corner : corners) middle += corner;
  return middle / static_cast<double>(corners.size());
}

std::span<const uint32_t> facesOfCell(const GatheredCells& cells, size_t n) {
  return facesOf(cells.shapes[n], cells.view(n, 0).faces);
}

/// Calls use(cell, whether it is plain, number of its first face), in parallel, after resize(number of faces).
template <typename Resize, typename Use>
void forEachCell(const GatheredCells& cells, const Resize& resize, const Use& use) {
  std::vector<size_t> begin(cells.size() + 1, 0);
  for (size_t n = 0; n < cells.size(); ++n)
    begin[n + 1] = begin[n] + (cells.shapes[n] == CellKind::kNone ? 0 : countOf(facesOfCell(cells, n)));
  resize(begin.back());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, cells.size(), kCellsPerTask),
                    [&](const tbb::blocked_range<size_t>& part) {
                      for (size_t n = part.begin(); n < part.end(); ++n) {
                        if (cells.shapes[n] == CellKind::kNone) continue;
                        const bool is_plain =
                            cells.shapes[n] != CellKind::kPolyhedron && areDifferent(cells.cornersOfCell(n));
                        use(n, is_plain, begin[n]);
                      }
                    });
}

FaceCorners lowestOf(std::span<const uint64_t> corners, std::span<const uint32_t> face, bool is_plain) {
  return is_plain ? lowestOfPlain(corners, face) : lowestOf(corners, face);
}

/// Leaves out collapsed faces. `move`: from, to.
template <typename Move>
size_t leaveOutCollapsed(std::vector<FaceCorners>& corners, const Move& move) {
  size_t kept = 0;
  for (size_t n = 0; n < corners.size(); ++n) {
    if (corners[n][2] == UINT64_MAX) continue;
    if (kept != n) {
      corners[kept] = corners[n];
      move(n, kept);
    }
    ++kept;
  }
  corners.resize(kept);
  return kept;
}

}  // namespace

void facesOfCells(const GatheredCells& cells, size_t record_bytes,
                  const std::function<void(const HalfFace&, std::span<std::byte>)>& put, FaceRecords& out) {
  const auto resize = [&](size_t faces) {
    out.corners.resize(faces);
    out.records.resize(faces * record_bytes);
  };
  forEachCell(cells, resize, [&](size_t n, bool is_plain, size_t to) {
    const CellView view = cells.view(n, 0);
    const glm::dvec3 middle = middleOf(view.corners);
    const std::span<const uint32_t> faces = facesOfCell(cells, n);
    for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}, ++to) {
      HalfFace face{n, faces.subspan(at + 1, faces[at]), is_plain, {}, {}};
      out.corners[to] = lowestOf(cells.cornersOfCell(n), face.corners, is_plain);
      if (out.corners[to][2] == UINT64_MAX) continue;
      measure(view.corners, middle, face);
      put(face, std::span(out.records).subspan(to * record_bytes, record_bytes));
    }
  });
  const size_t kept = leaveOutCollapsed(out.corners, [&](size_t from, size_t to) {
    std::memmove(out.records.data() + to * record_bytes, out.records.data() + from * record_bytes,
                 record_bytes);
  });
  out.records.resize(kept * record_bytes);
}

void FaceList::assign(const GatheredCells& cells) {
  const auto resize = [&](size_t faces) {
    corners.resize(faces);
    places.resize(faces);
  };
  forEachCell(cells, resize, [&](size_t n, bool is_plain, size_t to) {
    const std::span<const uint32_t> faces = facesOfCell(cells, n);
    for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}, ++to) {
      corners[to] = lowestOf(cells.cornersOfCell(n), faces.subspan(at + 1, faces[at]), is_plain);
      places[to] = {static_cast<uint32_t>(n), static_cast<uint32_t>(at), is_plain};
    }
  });
  places.resize(leaveOutCollapsed(corners, [&](size_t from, size_t to) { places[to] = places[from]; }));
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
