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

void measure(std::span<const glm::dvec3> at, const glm::dvec3& middle, CellFace& face) {
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

}  // namespace

void facesOfCells(const GatheredCells& cells, size_t record_bytes,
                  const std::function<void(const CellFace&, std::span<std::byte>)>& put, FaceRecords& out) {
  const auto facesOfCell = [&](size_t n) { return facesOf(cells.shapes[n], cells.view(n, 0).faces); };
  std::vector<size_t> begin(cells.size() + 1, 0);
  for (size_t n = 0; n < cells.size(); ++n)
    begin[n + 1] = begin[n] + (cells.shapes[n] == CellKind::kNone ? 0 : countOf(facesOfCell(n)));
  out.corners.resize(begin.back());
  out.records.resize(begin.back() * record_bytes);
  tbb::parallel_for(tbb::blocked_range<size_t>(0, cells.size(), kCellsPerTask),
                    [&](const tbb::blocked_range<size_t>& part) {
                      for (size_t n = part.begin(); n < part.end(); ++n) {
                        if (cells.shapes[n] == CellKind::kNone) continue;
                        const CellView view = cells.view(n, 0);
                        glm::dvec3 middle(0.0);
                        for (const glm::dvec3& corner : view.corners) middle += corner;
                        middle /= static_cast<double>(view.corners.size());
                        const std::span<const uint32_t> faces = facesOfCell(n);
                        size_t to = begin[n];
                        for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}, ++to) {
                          CellFace face{n, faces.subspan(at + 1, faces[at]), {}, {}};
                          out.corners[to] = lowestOf(cells.cornersOfCell(n), face.corners);
                          if (out.corners[to][2] == UINT64_MAX) continue;
                          measure(view.corners, middle, face);
                          put(face, std::span(out.records).subspan(to * record_bytes, record_bytes));
                        }
                      }
                    });
  size_t kept = 0;
  for (size_t n = 0; n < out.corners.size(); ++n) {
    if (out.corners[n][2] == UINT64_MAX) continue;
    if (kept != n) {
      out.corners[kept] = out.corners[n];
      std::memmove(out.records.data() + kept * record_bytes, out.records.data() + n * record_bytes,
                   record_bytes);
    }
    ++kept;
  }
  out.corners.resize(kept);
  out.records.resize(kept * record_bytes);
}

}  // namespace curvisplat
