#include "preprocess/moments/cell_moments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

/// Six times the volume of the tetrahedron (a, b, f, 0).
double sixVolumes(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& f) {
  return std::abs(glm::dot(a, glm::cross(b, f)));
}

/// A vertex of a piece: where it is and the fields there.
struct Vertex {
  glm::dvec3 at;
  const double* values;
};

/// Adds the moments of the tetrahedron (a, b, f, origin) of `volume`; at the origin all fields are 0.
void addPiece(double volume, const Vertex& a, const Vertex& b, const Vertex& f, size_t fields, double* sums) {
  const glm::dvec3 s = a.at + b.at + f.at;
  const double first = volume / 4, second = volume / 20;
  sums[0] += volume;
  sums[1] += first * s.x;
  sums[2] += first * s.y;
  sums[3] += first * s.z;
  const auto product = [&](int i, int j) {
    return second * (a.at[i] * a.at[j] + b.at[i] * b.at[j] + f.at[i] * f.at[j] + s[i] * s[j]);
  };
  sums[4] += product(0, 0);
  sums[5] += product(0, 1);
  sums[6] += product(1, 1);
  sums[7] += product(0, 2);
  sums[8] += product(1, 2);
  sums[9] += product(2, 2);
  double* of_field = sums + 10;
  for (size_t n = 0; n < fields; ++n, of_field += 5) {
    const double ga = a.values[n], gb = b.values[n], gf = f.values[n], gs = ga + gb + gf;
    of_field[0] += first * gs;
    const glm::dvec3 slope = second * (ga * a.at + gb * b.at + gf * f.at + gs * s);
    of_field[1] += slope.x;
    of_field[2] += slope.y;
    of_field[3] += slope.z;
    of_field[4] += second * (ga * ga + gb * gb + gf * gf + gs * gs);
  }
}

/// Moments about the origin become those about `-by` and the values `-values_by`.
void shift(const glm::dvec3& by, const double* values_by, size_t fields, double* m) {
  const double volume = m[0];
  const glm::dvec3 first(m[1], m[2], m[3]);
  const auto square = [&](int i, int j) {
    return first[i] * by[j] + first[j] * by[i] + volume * by[i] * by[j];
  };
  m[4] += square(0, 0);
  m[5] += square(0, 1);
  m[6] += square(1, 1);
  m[7] += square(0, 2);
  m[8] += square(1, 2);
  m[9] += square(2, 2);
  double* of_field = m + 10;
  for (size_t n = 0; n < fields; ++n, of_field += 5) {
    const double g = values_by[n], sum = of_field[0];
    of_field[4] += 2 * g * sum + volume * g * g;
    for (int i = 0; i < 3; ++i) of_field[1 + i] += g * first[i] + by[i] * sum + volume * g * by[i];
    of_field[0] += volume * g;
  }
  for (int i = 0; i < 3; ++i) m[1 + i] += volume * by[i];
}

// A tetrahedron's corner gets a quarter of it. Means over that quarter of the barycentric coordinate of another
// corner, its square, and its product with that of a third: from addPiece() of the six pieces, which are equal.
constexpr double kMeanOther = 23.0 / 144, kMeanSquare = 322.0 / 8640, kMeanProduct = 194.0 / 8640;

void tetrahedronMoments(const CellView& cell, size_t fields, std::span<double> out) {
  const auto at = cell.corners;
  const double volume = std::abs(glm::dot(at[1] - at[0], glm::cross(at[2] - at[0], at[3] - at[0]))) / 24;
  const double first = volume * kMeanOther, alike = volume * (kMeanSquare - kMeanProduct),
               mixed = volume * kMeanProduct;
  for (size_t corner = 0; corner < 4; ++corner) {
    double* m = out.data() + corner * momentCount(fields);
    const size_t other[] = {corner ^ 1, corner ^ 2, corner ^ 3};
    const glm::dvec3 e[] = {at[other[0]] - at[corner], at[other[1]] - at[corner], at[other[2]] - at[corner]};
    const glm::dvec3 s = e[0] + e[1] + e[2];
    m[0] = volume;
    m[1] = first * s.x;
    m[2] = first * s.y;
    m[3] = first * s.z;
    const auto product = [&](int i, int j) {
      return alike * (e[0][i] * e[0][j] + e[1][i] * e[1][j] + e[2][i] * e[2][j]) + mixed * s[i] * s[j];
    };
    m[4] = product(0, 0);
    m[5] = product(0, 1);
    m[6] = product(1, 1);
    m[7] = product(0, 2);
    m[8] = product(1, 2);
    m[9] = product(2, 2);
    for (size_t n = 0; n < fields; ++n) {
      const auto difference = [&](size_t k) {
        return static_cast<double>(cell.values[other[k] * fields + n]) - cell.values[corner * fields + n];
      };
      const double g[] = {difference(0), difference(1), difference(2)}, gs = g[0] + g[1] + g[2];
      const glm::dvec3 slope = alike * (g[0] * e[0] + g[1] * e[1] + g[2] * e[2]) + mixed * gs * s;
      double* of_field = m + 10 + 5 * n;
      of_field[0] = first * gs;
      of_field[1] = slope.x;
      of_field[2] = slope.y;
      of_field[3] = slope.z;
      of_field[4] = alike * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) + mixed * gs * gs;
    }
  }
}

glm::dvec3 meanOf(std::span<const glm::dvec3> corners) {
  glm::dvec3 sum(0.0);
  for (const glm::dvec3& corner : corners) sum += corner;
  return sum / static_cast<double>(corners.size());
}

/// The body of a tetrahedron: C = (1/20) Σ (y - ȳ)(y - ȳ)ᵀ.
CellBody bodyOfTetrahedron(std::span<const glm::dvec3> at) {
  CellBody body;
  body.volume = sixVolumes(at[1] - at[0], at[2] - at[0], at[3] - at[0]) / 6;
  body.centre = meanOf(at);
  if (!(body.volume > 0)) return body;
  std::array<glm::dvec3, 4> y;
  for (size_t n = 0; n < 4; ++n) y[n] = at[n] - body.centre;
  const auto covariance = [&](int i, int j) {
    return 0.6 * ((y[0][i] * y[0][j] + y[1][i] * y[1][j]) + (y[2][i] * y[2][j] + y[3][i] * y[3][j]));
  };
  body.xx = covariance(0, 0);
  body.xy = covariance(0, 1);
  body.yy = covariance(1, 1);
  body.xz = covariance(0, 2);
  body.yz = covariance(1, 2);
  body.zz = covariance(2, 2);
  return body;
}

}  // namespace

void dualMoments(const CellView& cell, size_t fields, DualScratch& scratch, std::span<double> out) {
  if (cell.shape == CellKind::kTetrahedron) return tetrahedronMoments(cell, fields, out);
  const size_t corners = cell.corners.size(), stride = momentCount(fields);
  std::fill(out.begin(), out.end(), 0.0);

  // About the cell's centre.
  const glm::dvec3 centre = meanOf(cell.corners);
  scratch.at.resize(corners);
  for (size_t n = 0; n < corners; ++n) scratch.at[n] = cell.corners[n] - centre;
  scratch.values.assign(corners * fields, 0.0);
  scratch.of_face.resize(3 * fields);
  for (size_t field = 0; field < fields; ++field) {
    double sum = 0;
    for (size_t n = 0; n < corners; ++n) sum += cell.values[n * fields + field];
    const double mean = sum / static_cast<double>(corners);
    for (size_t n = 0; n < corners; ++n)
      scratch.values[n * fields + field] = cell.values[n * fields + field] - mean;
  }
  double* const of_face = scratch.of_face.data();
  double* const of_middle = of_face + fields;
  const std::span<const uint32_t> faces = facesOf(cell.shape, cell.faces);
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
    const std::span<const uint32_t> face = faces.subspan(at + 1, faces[at]);
    const double share = 1 / static_cast<double>(face.size());
    glm::dvec3 middle_of_face(0.0);
    std::fill_n(of_face, fields, 0.0);
    for (const uint32_t corner : face) {
      middle_of_face += share * scratch.at[corner];
      for (size_t field = 0; field < fields; ++field)
        of_face[field] += share * scratch.values[corner * fields + field];
    }
    const Vertex f{middle_of_face, of_face};
    for (size_t edge = 0; edge < face.size(); ++edge) {
      const size_t a = face[edge], b = face[edge + 1 == face.size() ? 0 : edge + 1];
      const double volume = sixVolumes(scratch.at[a], scratch.at[b], middle_of_face) / 12;
      if (!(volume > 0)) continue;
      for (size_t field = 0; field < fields; ++field)
        of_middle[field] = 0.5 * (scratch.values[a * fields + field] + scratch.values[b * fields + field]);
      const Vertex m{0.5 * (scratch.at[a] + scratch.at[b]), of_middle};
      for (const size_t end : {a, b})
        addPiece(volume, {scratch.at[end], scratch.values.data() + end * fields}, m, f, fields,
                 &out[end * stride]);
    }
  }

  // About each corner.
  for (size_t n = 0; n < corners; ++n) {
    for (size_t field = 0; field < fields; ++field) of_face[field] = -scratch.values[n * fields + field];
    shift(-scratch.at[n], of_face, fields, &out[n * stride]);
  }
}

CellBody bodyOf(const CellView& cell) {
  if (cell.shape == CellKind::kTetrahedron) return bodyOfTetrahedron(cell.corners);
  const glm::dvec3 middle = meanOf(cell.corners);
  std::array<double, 10> sums{};
  const auto add = [&](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& f) {
    addPiece(sixVolumes(a, b, f) / 6, {a, nullptr}, {b, nullptr}, {f, nullptr}, 0, sums.data());
  };
  const std::span<const uint32_t> faces = facesOf(cell.shape, cell.faces);
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) {
    const std::span<const uint32_t> face = faces.subspan(at + 1, faces[at]);
    glm::dvec3 middle_of_face(0.0);
    for (const uint32_t corner : face) middle_of_face += cell.corners[corner] - middle;
    middle_of_face /= static_cast<double>(face.size());
    for (size_t edge = 0; edge < face.size(); ++edge)
      add(cell.corners[face[edge]] - middle,
          cell.corners[face[edge + 1 == face.size() ? 0 : edge + 1]] - middle, middle_of_face);
  }
  return bodyFrom(middle, sums);
}

CellBody bodyFrom(const glm::dvec3& middle, std::span<const double, 10> moments) {
  CellBody body;
  body.volume = moments[0];
  body.centre = middle;
  if (!(body.volume > 0)) return body;
  const glm::dvec3 mean(moments[1] / moments[0], moments[2] / moments[0], moments[3] / moments[0]);
  body.centre += mean;
  const auto covariance = [&](size_t number, int i, int j) {
    return 12 * (moments[number] / moments[0] - mean[i] * mean[j]);
  };
  body.xx = covariance(4, 0, 0);
  body.xy = covariance(5, 0, 1);
  body.yy = covariance(6, 1, 1);
  body.xz = covariance(7, 0, 2);
  body.yz = covariance(8, 1, 2);
  body.zz = covariance(9, 2, 2);
  return body;
}

}  // namespace curvisplat
