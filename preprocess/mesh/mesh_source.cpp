#include "preprocess/mesh/mesh_source.h"

#include <algorithm>
#include <array>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr std::array<uint32_t, 16> kTetrahedron{3, 0, 1, 2, 3, 0, 3, 1, 3, 1, 3, 2, 3, 0, 2, 3};
constexpr std::array<uint32_t, 21> kPyramid{4, 0, 3, 2, 1, 3, 0, 1, 4, 3, 1, 2, 4, 3, 2, 3, 4, 3, 3, 0, 4};
constexpr std::array<uint32_t, 23> kWedge{3, 0, 1, 2, 3, 3, 5, 4, 4, 0, 3, 4,
                                          1, 4, 1, 4, 5, 2, 4, 2, 5, 3, 0};
constexpr std::array<uint32_t, 30> kHexahedron{4, 0, 1, 2, 3, 4, 4, 7, 6, 5, 4, 0, 4, 5, 1,
                                               4, 1, 5, 6, 2, 4, 2, 6, 7, 3, 4, 3, 7, 4, 0};

}  // namespace

size_t cornersOf(CellKind shape) {
  switch (shape) {
    case CellKind::kTetrahedron:
      return 4;
    case CellKind::kPyramid:
      return 5;
    case CellKind::kWedge:
      return 6;
    case CellKind::kHexahedron:
      return 8;
    case CellKind::kNone:
    case CellKind::kPolyhedron:
      break;
  }
  return 0;
}

std::span<const uint32_t> facesOf(CellKind shape, std::span<const uint32_t> own) {
  switch (shape) {
    case CellKind::kTetrahedron:
      return kTetrahedron;
    case CellKind::kPyramid:
      return kPyramid;
    case CellKind::kWedge:
      return kWedge;
    case CellKind::kHexahedron:
      return kHexahedron;
    case CellKind::kNone:
    case CellKind::kPolyhedron:
      break;
  }
  return own;
}

void MeshCells::clear() {
  shapes.clear();
  corner_begin.assign(1, 0);
  corners.clear();
  face_begin.assign(1, 0);
  faces.clear();
  hidden.clear();
  curved.clear();
  volumes.clear();
}

void MeshCells::appendCurved(CellKind shape, CellCurve curve, std::span<const uint64_t> nodes) {
  append(shape, nodes);
  if (shapes.back() == CellKind::kNone) return;
  curved.emplace_back(shapes.size() - 1, curve);
  if (curve.order == 0) return;
  const std::span<const uint64_t> further = nodes.subspan(cornersOf(shape));
  corners.insert(corners.end(), further.begin(), further.end());
  corner_begin.back() = corners.size();
}

void MeshCells::append(CellKind shape, std::span<const uint64_t> of_cell) {
  if (cornersOf(shape) > of_cell.size()) shape = CellKind::kNone;
  const std::span<const uint64_t> used = of_cell.first(cornersOf(shape));
  shapes.push_back(shape);
  corners.insert(corners.end(), used.begin(), used.end());
  corner_begin.push_back(corners.size());
  face_begin.push_back(faces.size());
  hidden.push_back(0);
}

void MeshCells::appendOf(const MeshCells& others, size_t n) {
  if (others.shapes[n] != CellKind::kPolyhedron) return append(others.shapes[n], others.cornersOfCell(n));
  const std::span<const uint64_t> points = others.cornersOfCell(n);
  const std::span<const uint32_t> of_faces = others.facesOfCell(n);
  corners.insert(corners.end(), points.begin(), points.end());
  faces.insert(faces.end(), of_faces.begin(), of_faces.end());
  shapes.push_back(CellKind::kPolyhedron);
  corner_begin.push_back(corners.size());
  face_begin.push_back(faces.size());
  hidden.push_back(0);
}

void MeshCells::appendPrism(std::span<const uint64_t> points) {
  const size_t sides = points.size() / 2;
  if (sides < 3 || points.size() % 2 != 0) return append(CellKind::kNone, {});
  if (sides == 3) return append(CellKind::kWedge, points);
  if (sides == 4) return append(CellKind::kHexahedron, points);
  std::vector<uint64_t> stream;
  for (const size_t end : {size_t{0}, sides}) {
    stream.push_back(sides);
    for (size_t n = 0; n < sides; ++n) stream.push_back(points[end + n]);
  }
  for (size_t n = 0; n < sides; ++n) {
    const size_t next = n + 1 == sides ? 0 : n + 1;
    for (const uint64_t word :
         {uint64_t{4}, points[n], points[next], points[sides + next], points[sides + n]})
      stream.push_back(word);
  }
  appendPolyhedron(sides + 2, stream);
}

bool MeshCells::appendPolyhedron(uint64_t count, std::span<const uint64_t> stream) {
  const size_t begin = corners.size(), faces_before = faces.size();
  bool good = count >= 4;
  size_t at = 0;
  for (uint64_t face = 0; face < count && good; ++face) {
    good = at < stream.size() && stream[at] >= 3 && stream[at] <= stream.size() - at - 1;
    if (!good) break;
    const auto points = stream.subspan(at + 1, static_cast<size_t>(stream[at]));
    corners.insert(corners.end(), points.begin(), points.end());
    at += points.size() + 1;
  }
  good = good && at == stream.size();
  if (good) {
    std::sort(corners.begin() + static_cast<ptrdiff_t>(begin), corners.end());
    corners.erase(std::unique(corners.begin() + static_cast<ptrdiff_t>(begin), corners.end()), corners.end());
    for (at = 0; at < stream.size();) {
      const auto points = stream.subspan(at + 1, static_cast<size_t>(stream[at]));
      faces.push_back(static_cast<uint32_t>(points.size()));
      for (const uint64_t point : points)
        faces.push_back(static_cast<uint32_t>(
            std::lower_bound(corners.begin() + static_cast<ptrdiff_t>(begin), corners.end(), point) -
            corners.begin() - static_cast<ptrdiff_t>(begin)));
      at += points.size() + 1;
    }
  } else {
    corners.resize(begin);
    faces.resize(faces_before);
  }
  shapes.push_back(good ? CellKind::kPolyhedron : CellKind::kNone);
  corner_begin.push_back(corners.size());
  face_begin.push_back(faces.size());
  hidden.push_back(0);
  return good;
}

bool isClosed(std::span<const uint32_t> faces) {
  std::vector<std::pair<uint32_t, uint32_t>> edges;
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
    const auto of_face = faces.subspan(at + 1, faces[at]);
    for (size_t n = 0; n < of_face.size(); ++n)
      if (const auto edge = std::minmax(of_face[n], of_face[(n + 1) % of_face.size()]);
          edge.first != edge.second)
        edges.emplace_back(edge);
  }
  std::sort(edges.begin(), edges.end());
  for (size_t n = 0; n < edges.size(); n += 2)
    if (n + 1 == edges.size() || edges[n] != edges[n + 1] ||
        (n + 2 < edges.size() && edges[n] == edges[n + 2]))
      return false;
  return true;
}

void checkCells(const MeshCells& cells, const MeshPiece& piece, uint64_t first) {
  for (size_t n = 0; n < cells.size(); ++n)
    for (const uint64_t point : cells.cornersOfCell(n))
      if (point >= piece.points)
        throw Error("{}: cell {} refers to point {}; expected 0 to {} ({} points); the file is damaged",
                    piece.file, first + n, static_cast<int64_t>(point), piece.points - 1, piece.points);
}

}  // namespace curvisplat
