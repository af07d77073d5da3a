#include "tests/reference/array_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Appends cell `n` of another mesh, whose points have other numbers here.
void appendCell(const ArrayPiece& from, size_t n, const std::function<uint64_t(uint64_t)>& renumber,
                bool reversed, ArrayPiece& to) {
  std::vector<uint64_t> corners;
  for (const uint64_t corner : from.cells.cornersOfCell(n)) corners.push_back(renumber(corner));
  if (from.cells.shapes[n] == CellKind::kPolyhedron) {
    std::vector<uint64_t> stream;
    uint64_t count = 0;
    const auto faces = from.cells.facesOfCell(n);
    for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}, ++count) {
      stream.push_back(faces[at]);
      for (const uint32_t place : faces.subspan(at + 1, faces[at])) stream.push_back(corners[place]);
    }
    CURVISPLAT_CHECK(to.cells.appendPolyhedron(count, stream));
  } else {
    if (reversed && from.cells.shapes[n] == CellKind::kTetrahedron) std::swap(corners[0], corners[1]);
    to.cells.append(from.cells.shapes[n], corners);
  }
  to.cell_values.push_back(from.cell_values[n]);
}

}  // namespace

ArrayMesh::ArrayMesh(std::vector<ArrayPiece> pieces) : pieces_(std::move(pieces)) {
  description_.format = "a mesh in memory";
  description_.files = {"mesh"};
  description_.coordinate_bytes = 8;
  for (size_t n = 0; n < pieces_.size(); ++n)
    description_.pieces.push_back(
        {fmt::format("piece {}", n + 1), "mesh", pieces_[n].points.size(), pieces_[n].cells.size()});
  description_.scalars.resize(2);
  description_.scalars[0].name = std::string(1, 'f');
  description_.scalars[1].name = std::string(1, 'c');
  description_.scalars[1].centring = Centring::kCell;
}

void ArrayMesh::readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshPoints& out) const {
  const ArrayPiece& of = pieces_.at(piece);
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(count);
  out.hidden.assign(count, 0);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < count; ++n) {
    out.x[n] = of.points[first + n].x;
    out.y[n] = of.points[first + n].y;
    out.z[n] = of.points[first + n].z;
  }
  for (std::vector<float>& values : out.scalars)
    values.assign(of.point_values.begin() + static_cast<ptrdiff_t>(first),
                  of.point_values.begin() + static_cast<ptrdiff_t>(first + count));
}

void ArrayMesh::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshCells& out) const {
  const ArrayPiece& of = pieces_.at(piece);
  out.clear();
  const auto begin = [](const auto& of_vector, size_t at) {
    return of_vector.begin() + static_cast<ptrdiff_t>(at);
  };
  const MeshCells& cells = of.cells;
  for (size_t n = first; n < first + count; ++n) {
    out.shapes.push_back(cells.shapes[n]);
    out.corners.insert(out.corners.end(), begin(cells.corners, cells.corner_begin[n]),
                       begin(cells.corners, cells.corner_begin[n + 1]));
    out.corner_begin.push_back(out.corners.size());
    out.faces.insert(out.faces.end(), begin(cells.faces, cells.face_begin[n]),
                     begin(cells.faces, cells.face_begin[n + 1]));
    out.face_begin.push_back(out.faces.size());
    out.hidden.push_back(cells.hidden[n]);
  }
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars)
    values.assign(begin(of.cell_values, first), begin(of.cell_values, first + count));
}

void setValues(ArrayPiece& piece, const std::function<double(const glm::dvec3&)>& field) {
  piece.point_values.clear();
  piece.cell_values.clear();
  for (const glm::dvec3& point : piece.points) piece.point_values.push_back(static_cast<float>(field(point)));
  for (size_t n = 0; n < piece.cells.size(); ++n) {
    glm::dvec3 sum(0.0);
    for (const uint64_t corner : piece.cells.cornersOfCell(n)) sum += piece.points[corner];
    piece.cell_values.push_back(
        static_cast<float>(field(sum / static_cast<double>(piece.cells.cornersOfCell(n).size()))));
  }
}

ArrayPiece tetrahedraOf(const Scene& scene, uint64_t nu, uint64_t nv, uint64_t nw) {
  const std::array<uint64_t, 3> n{nu, nv, nw};
  ArrayPiece piece;
  const auto add = [&](double u, double v, double w) { piece.points.push_back(scene.position({u, v, w})); };
  const auto share = [](double part, uint64_t whole) { return part / static_cast<double>(whole); };
  for (uint64_t k = 0; k <= nw; ++k)
    for (uint64_t j = 0; j <= nv; ++j)
      for (uint64_t i = 0; i <= nu; ++i)
        add(share(static_cast<double>(i), nu), share(static_cast<double>(j), nv),
            share(static_cast<double>(k), nw));
  const uint64_t lattice = piece.points.size();
  for (uint64_t k = 0; k < nw; ++k)
    for (uint64_t j = 0; j < nv; ++j)
      for (uint64_t i = 0; i < nu; ++i)
        add(share(static_cast<double>(i) + 0.5, nu), share(static_cast<double>(j) + 0.5, nv),
            share(static_cast<double>(k) + 0.5, nw));
  using Index = std::array<uint64_t, 3>;
  const auto corner = [&](const Index& at) { return (at[2] * (nv + 1) + at[1]) * (nu + 1) + at[0]; };
  const auto centre = [&](const Index& at) { return lattice + (at[2] * nv + at[1]) * nu + at[0]; };
  const auto append = [&](uint64_t a, uint64_t b, uint64_t c, uint64_t d) {
    piece.cells.append(CellKind::kTetrahedron, std::array<uint64_t, 4>{a, b, c, d});
  };
  Index at;
  for (size_t axis = 0; axis < 3; ++axis)
    for (at[2] = 0; at[2] < nw + (axis == 2); ++at[2])
      for (at[1] = 0; at[1] < nv + (axis == 1); ++at[1])
        for (at[0] = 0; at[0] < nu + (axis == 0); ++at[0]) {
          // The face of the lattice at `at`, at right angles to the axis.
          const size_t b = (axis + 1) % 3, c = (axis + 2) % 3;
          std::array<uint64_t, 4> face;
          for (size_t m = 0; m < 4; ++m) {
            Index place = at;
            place[b] += m == 1 || m == 2;
            place[c] += m >= 2;
            face[m] = corner(place);
          }
          Index before = at;
          if (at[axis] > 0 && at[axis] < n[axis]) {
            --before[axis];
            for (size_t m = 0; m < 4; ++m) append(centre(before), centre(at), face[m], face[(m + 1) % 4]);
          } else {
            if (at[axis] > 0) --before[axis];
            append(face[0], face[1], face[2], centre(before));
            append(face[0], face[2], face[3], centre(before));
          }
        }
  setValues(piece, [&](const glm::dvec3& x) { return scene.scalar(x); });
  return piece;
}

ArrayPiece hexahedraOf(const Scene& scene, uint64_t nu, uint64_t nv, uint64_t nw) {
  ArrayPiece piece;
  for (uint64_t k = 0; k <= nw; ++k)
    for (uint64_t j = 0; j <= nv; ++j)
      for (uint64_t i = 0; i <= nu; ++i)
        piece.points.push_back(scene.position({static_cast<double>(i) / static_cast<double>(nu),
                                               static_cast<double>(j) / static_cast<double>(nv),
                                               static_cast<double>(k) / static_cast<double>(nw)}));
  for (uint64_t k = 0; k < nw; ++k)
    for (uint64_t j = 0; j < nv; ++j)
      for (uint64_t i = 0; i < nu; ++i) {
        const uint64_t a = (k * (nv + 1) + j) * (nu + 1) + i, up = (nu + 1) * (nv + 1), on = nu + 1;
        piece.cells.append(CellKind::kHexahedron,
                           std::array<uint64_t, 8>{a, a + 1, a + on + 1, a + on, a + up, a + up + 1,
                                                   a + up + on + 1, a + up + on});
      }
  setValues(piece, [&](const glm::dvec3& x) { return scene.scalar(x); });
  return piece;
}

ArrayPiece shuffled(const ArrayPiece& piece, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<uint64_t> number(piece.points.size()), cells(piece.cells.size());
  std::iota(number.begin(), number.end(), 0u);
  std::iota(cells.begin(), cells.end(), 0u);
  std::shuffle(number.begin(), number.end(), random);
  std::shuffle(cells.begin(), cells.end(), random);
  ArrayPiece out;
  out.points.resize(piece.points.size());
  out.point_values.resize(piece.points.size());
  for (size_t n = 0; n < number.size(); ++n) {
    out.points[number[n]] = piece.points[n];
    out.point_values[number[n]] = piece.point_values[n];
  }
  for (size_t n = 0; n < cells.size(); ++n)
    appendCell(
        piece, cells[n], [&](uint64_t corner) { return number[corner]; }, n % 2 != 0, out);
  return out;
}

ArrayPiece boxesOf(const std::vector<Box>& boxes) {
  ArrayPiece piece;
  std::map<std::array<uint64_t, 3>, uint64_t> numbers;
  for (const Box& box : boxes) {
    std::array<uint64_t, 8> corners;
    for (size_t corner = 0; corner < 8; ++corner) {
      std::array<uint64_t, 3> at = box.low;
      const size_t ring = corner % 4;
      at[0] += ring == 1 || ring == 2 ? box.size : 0;
      at[1] += ring >= 2 ? box.size : 0;
      at[2] += corner >= 4 ? box.size : 0;
      const auto [found, is_new] = numbers.emplace(at, piece.points.size());
      if (is_new) piece.points.push_back(glm::dvec3(at[0], at[1], at[2]));
      corners[corner] = found->second;
    }
    piece.cells.append(CellKind::kHexahedron, corners);
  }
  setValues(piece, [](const glm::dvec3& x) { return 3 + x.x - 2 * x.y + 0.5 * x.z; });
  return piece;
}

ArrayPiece partedCube(uint64_t n) {
  std::vector<Box> boxes;
  for (uint64_t cell = 0; cell < n * n * n; ++cell) {
    const std::array<uint64_t, 3> low{2 * (cell % n), 2 * (cell / n % n), 2 * (cell / n / n)};
    if ((low[0] + low[1] + low[2]) % 4 != 0)
      boxes.push_back({low, 2});
    else
      for (uint64_t part = 0; part < 8; ++part)
        boxes.push_back({{low[0] + part % 2, low[1] + part / 2 % 2, low[2] + part / 4}, 1});
  }
  return boxesOf(boxes);
}

std::vector<ArrayPiece> split(const ArrayPiece& piece, size_t pieces,
                              const std::function<size_t(size_t cell)>& part) {
  constexpr uint64_t kNone = std::numeric_limits<uint64_t>::max();
  std::vector<ArrayPiece> out(pieces);
  std::vector<std::vector<uint64_t>> numbers(pieces, std::vector<uint64_t>(piece.points.size(), kNone));
  for (size_t n = 0; n < piece.cells.size(); ++n) {
    const size_t to = part(n);
    appendCell(
        piece, n,
        [&](uint64_t corner) {
          uint64_t& number = numbers[to][corner];
          if (number == kNone) {
            number = out[to].points.size();
            out[to].points.push_back(piece.points[corner]);
            out[to].point_values.push_back(piece.point_values[corner]);
          }
          return number;
        },
        false, out[to]);
  }
  return out;
}

}  // namespace curvisplat
