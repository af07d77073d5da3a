#include "preprocess/moments/cell_moments.h"

#include <array>

#include "stream/base/error.h"
#include "stream/base/vector_clones.h"

// About functions that take or return vectors: all of them are inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace curvisplat {
namespace {

constexpr size_t kMaxFields = 4, kMaxCorners = 8;
constexpr size_t kMaxMoments = momentCount(kMaxFields);

/// A number of each cell.
using Four = double __attribute__((vector_size(kCellsAtOnce * sizeof(double))));

struct Four3 {
  Four x, y, z;
};
/// Symmetric matrices: xx xy yy xz yz zz.
struct Squares {
  Four of[6];
};

#define CURVISPLAT_INLINE [[gnu::always_inline]] inline

CURVISPLAT_INLINE Four3 plus(const Four3& a, const Four3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
CURVISPLAT_INLINE Four3 times(double factor, const Four3& v) {
  return {factor * v.x, factor * v.y, factor * v.z};
}
CURVISPLAT_INLINE Squares squaresOf(const Four3& v) {
  return {{v.x * v.x, v.x * v.y, v.y * v.y, v.x * v.z, v.y * v.z, v.z * v.z}};
}
/// |a · (b × f)|. Not returned, as some processors have no register for it.
CURVISPLAT_INLINE void setSixVolumes(const Four3& a, const Four3& b, const Four3& f, Four& volumes) {
  volumes = a.x * (b.y * f.z - f.y * b.z) + a.y * (b.z * f.x - f.z * b.x) + a.z * (b.x * f.y - f.x * b.y);
  volumes = volumes < 0 ? -volumes : volumes;
}

/// A vertex of pieces: where it is, and the fields there.
struct FourVertices {
  Four3 at;
  Squares squares;
  Four values[kMaxFields];
};

/// The weights of a piece's moments.
struct PieceWeights {
  Four volume, first, second;
};

/// addPiece() of cell_moments.cpp, in its order of operations.
CURVISPLAT_INLINE void addFourPieces(const PieceWeights& weights, const FourVertices& a,
                                     const FourVertices& b, const FourVertices& f, size_t fields,
                                     Four* sums) {
  const Four3 s = plus(plus(a.at, b.at), f.at);
  const Four first = weights.first, second = weights.second;
  const Squares of_sum = squaresOf(s);
  sums[0] += weights.volume;
  sums[1] += first * s.x;
  sums[2] += first * s.y;
  sums[3] += first * s.z;
  for (size_t n = 0; n < 6; ++n)
    sums[4 + n] += second * (a.squares.of[n] + b.squares.of[n] + f.squares.of[n] + of_sum.of[n]);
  Four* of_field = sums + 10;
  for (size_t n = 0; n < fields; ++n, of_field += 5) {
    const Four ga = a.values[n], gb = b.values[n], gf = f.values[n], gs = ga + gb + gf;
    of_field[0] += first * gs;
    of_field[1] += second * (ga * a.at.x + gb * b.at.x + gf * f.at.x + gs * s.x);
    of_field[2] += second * (ga * a.at.y + gb * b.at.y + gf * f.at.y + gs * s.y);
    of_field[3] += second * (ga * a.at.z + gb * b.at.z + gf * f.at.z + gs * s.z);
    of_field[4] += second * (ga * ga + gb * gb + gf * gf + gs * gs);
  }
}

/// shift() of cell_moments.cpp, by the corner and its values, negative.
CURVISPLAT_INLINE void shiftTo(const FourVertices& corner, size_t fields, Four* m) {
  const Four volume = m[0], first[3] = {m[1], m[2], m[3]};
  const Four by[3] = {-corner.at.x, -corner.at.y, -corner.at.z};
  constexpr size_t kRow[6] = {0, 0, 1, 0, 1, 2}, kColumn[6] = {0, 1, 1, 2, 2, 2};
  for (size_t n = 0; n < 6; ++n) {
    const size_t i = kRow[n], j = kColumn[n];
    m[4 + n] += first[i] * by[j] + first[j] * by[i] + volume * by[i] * by[j];
  }
  Four* of_field = m + 10;
  for (size_t n = 0; n < fields; ++n, of_field += 5) {
    const Four g = -corner.values[n], sum = of_field[0];
    of_field[4] += 2.0 * g * sum + volume * g * g;
    for (size_t i = 0; i < 3; ++i) of_field[1 + i] += g * first[i] + by[i] * sum + volume * g * by[i];
    of_field[0] += volume * g;
  }
  for (size_t i = 0; i < 3; ++i) m[1 + i] += volume * by[i];
}

/// The corners about the cells' centres, which it returns, and the values about their means.
CURVISPLAT_INLINE Four3 takeCorners(std::span<const CellView> cells, size_t fields, FourVertices* out) {
  const size_t corners = cells[0].corners.size();
  const auto count = static_cast<double>(corners);
  Four3 centre{};
  for (size_t n = 0; n < corners; ++n) {
    for (size_t lane = 0; lane < kCellsAtOnce; ++lane) {
      const glm::dvec3& at = cells[lane].corners[n];
      out[n].at.x[lane] = at.x;
      out[n].at.y[lane] = at.y;
      out[n].at.z[lane] = at.z;
      for (size_t field = 0; field < fields; ++field)
        out[n].values[field][lane] = cells[lane].values[n * fields + field];
    }
    centre = plus(centre, out[n].at);
  }
  centre = {centre.x / count, centre.y / count, centre.z / count};
  for (size_t n = 0; n < corners; ++n) {
    Four3& at = out[n].at;
    at = {at.x - centre.x, at.y - centre.y, at.z - centre.z};
    out[n].squares = squaresOf(at);
  }
  for (size_t field = 0; field < fields; ++field) {
    Four sum{};
    for (size_t n = 0; n < corners; ++n) sum += out[n].values[field];
    const Four mean = sum / count;
    for (size_t n = 0; n < corners; ++n) out[n].values[field] -= mean;
  }
  return centre;
}

}  // namespace

bool isTakenAtOnce(CellKind shape, size_t fields) {
  return fields <= kMaxFields &&
         (shape == CellKind::kPyramid || shape == CellKind::kWedge || shape == CellKind::kHexahedron);
}

CURVISPLAT_VECTOR_CLONES bool dualMomentsOfFour(std::span<const CellView> cells, size_t fields,
                                                std::span<double> out) {
  CURVISPLAT_CHECK(cells.size() == kCellsAtOnce && isTakenAtOnce(cells[0].shape, fields));
  const size_t corners = cells[0].corners.size(), stride = momentCount(fields);
  FourVertices vertices[kMaxCorners];
  takeCorners(cells, fields, vertices);
  Four sums[kMaxCorners][kMaxMoments] = {};
  const std::span<const uint32_t> faces = facesOf(cells[0].shape, {});
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
    const std::span<const uint32_t> face = faces.subspan(at + 1, faces[at]);
    const double share = 1 / static_cast<double>(face.size());
    FourVertices f{};
    for (const uint32_t corner : face) {
      f.at = plus(f.at, times(share, vertices[corner].at));
      for (size_t field = 0; field < fields; ++field)
        f.values[field] += share * vertices[corner].values[field];
    }
    f.squares = squaresOf(f.at);
    for (size_t edge = 0; edge < face.size(); ++edge) {
      const uint32_t a = face[edge], b = face[edge + 1 == face.size() ? 0 : edge + 1];
      Four volume;
      setSixVolumes(vertices[a].at, vertices[b].at, f.at, volume);
      volume /= 12.0;
      for (size_t lane = 0; lane < kCellsAtOnce; ++lane)
        if (!(volume[lane] > 0)) return false;
      FourVertices m;
      m.at = times(0.5, plus(vertices[a].at, vertices[b].at));
      m.squares = squaresOf(m.at);
      for (size_t field = 0; field < fields; ++field)
        m.values[field] = 0.5 * (vertices[a].values[field] + vertices[b].values[field]);
      const PieceWeights weights{volume, volume / 4.0, volume / 20.0};
      for (const uint32_t end : {a, b}) addFourPieces(weights, vertices[end], m, f, fields, sums[end]);
    }
  }
  for (size_t n = 0; n < corners; ++n) {
    shiftTo(vertices[n], fields, sums[n]);
    for (size_t lane = 0; lane < kCellsAtOnce; ++lane) {
      double* to = &out[(lane * corners + n) * stride];
      for (size_t m = 0; m < stride; ++m) to[m] = sums[n][m][lane];
    }
  }
  return true;
}

CURVISPLAT_VECTOR_CLONES void setBodiesOfFour(std::span<const CellView> cells, std::span<CellBody> out) {
  CURVISPLAT_CHECK(cells.size() == kCellsAtOnce && isTakenAtOnce(cells[0].shape, 0));
  FourVertices vertices[kMaxCorners];
  const Four3 centre = takeCorners(cells, 0, vertices);
  Four sums[momentCount(0)] = {};
  const std::span<const uint32_t> faces = facesOf(cells[0].shape, {});
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
    const std::span<const uint32_t> face = faces.subspan(at + 1, faces[at]);
    const auto count = static_cast<double>(face.size());
    FourVertices f{};
    for (const uint32_t corner : face) f.at = plus(f.at, vertices[corner].at);
    f.at = {f.at.x / count, f.at.y / count, f.at.z / count};
    f.squares = squaresOf(f.at);
    for (size_t edge = 0; edge < face.size(); ++edge) {
      const uint32_t a = face[edge], b = face[edge + 1 == face.size() ? 0 : edge + 1];
      Four volume;
      setSixVolumes(vertices[a].at, vertices[b].at, f.at, volume);
      volume /= 6.0;
      addFourPieces({volume, volume / 4.0, volume / 20.0}, vertices[a], vertices[b], f, 0, sums);
    }
  }
  for (size_t lane = 0; lane < kCellsAtOnce; ++lane) {
    std::array<double, momentCount(0)> of_cell;
    for (size_t m = 0; m < of_cell.size(); ++m) of_cell[m] = sums[m][lane];
    out[lane] = bodyFrom({centre.x[lane], centre.y[lane], centre.z[lane]}, of_cell);
  }
}

}  // namespace curvisplat
