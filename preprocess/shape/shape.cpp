#include "preprocess/shape/shape.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace curvisplat {
namespace {

// Singular values this small, relative to the largest, are the rounding of the others.
constexpr double kNoise = 0x1p-50;

/// m V = U diag(σ) with V orthogonal, U's columns of length one and orthogonal, σ falling.
struct Svd {
  glm::dmat3 u, v;
  std::array<double, 3> sigma;
};

glm::dvec3 anyPerpendicular(const glm::dvec3& unit) {
  int least = 0;
  for (int axis = 1; axis < 3; ++axis)
    if (std::abs(unit[axis]) < std::abs(unit[least])) least = axis;
  glm::dvec3 other(0.0);
  other[least] = 1;
  return glm::normalize(glm::cross(unit, other));
}

/// Turns columns p and q until they are orthogonal (one-sided Jacobi). False if they were.
bool makeOrthogonal(glm::dmat3& b, glm::dmat3& v, int p, int q) {
  const double pp = glm::dot(b[p], b[p]), qq = glm::dot(b[q], b[q]), pq = glm::dot(b[p], b[q]);
  if (std::abs(pq) <= std::numeric_limits<double>::epsilon() * std::sqrt(pp) * std::sqrt(qq)) return false;
  const double zeta = (qq - pp) / (2 * pq);
  const double tangent = std::copysign(1 / (std::abs(zeta) + std::hypot(1.0, zeta)), zeta);
  const double cosine = 1 / std::hypot(1.0, tangent), sine = cosine * tangent;
  for (glm::dmat3* m : {&b, &v}) {
    const glm::dvec3 old = (*m)[p];
    (*m)[p] = cosine * old - sine * (*m)[q];
    (*m)[q] = sine * old + cosine * (*m)[q];
  }
  return true;
}

double largestEntry(const glm::dmat3& m) {
  double largest = 0;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(m[column][row]));
  return largest;
}

/// The singular value decomposition of a matrix that is not zero and whose entries are about 1 at most.
/// Hestenes' method: it keeps the digits of small columns (thin cells), which a diagonalisation of mᵀm would
/// lose.
Svd decompose(const glm::dmat3& m) {
  glm::dmat3 b = m, v(1.0);
  constexpr int kMaxSweeps = 30;  // it converges quadratically; 3x3 takes four to six
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    const bool turned_01 = makeOrthogonal(b, v, 0, 1);
    const bool turned_02 = makeOrthogonal(b, v, 0, 2);
    const bool turned_12 = makeOrthogonal(b, v, 1, 2);
    if (!turned_01 && !turned_02 && !turned_12) break;
  }
  std::array<std::pair<double, int>, 3> order;
  for (int n = 0; n < 3; ++n) order[n] = {-glm::length(b[n]), n};
  std::sort(order.begin(), order.end());

  Svd svd;
  for (int n = 0; n < 3; ++n) {
    svd.sigma[n] = -order[n].first;
    svd.v[n] = v[order[n].second];
    svd.u[n] = b[order[n].second];
  }
  // Directions without a length are free: any that complete the others will do.
  svd.u[0] /= svd.sigma[0];
  svd.u[1] = svd.sigma[1] > kNoise * svd.sigma[0]
                 ? glm::normalize(svd.u[1] - glm::dot(svd.u[1], svd.u[0]) * svd.u[0])
                 : anyPerpendicular(svd.u[0]);
  const glm::dvec3 third = glm::cross(svd.u[0], svd.u[1]);
  svd.u[2] = glm::dot(third, svd.u[2]) < 0 ? -third : third;
  return svd;
}

LqFactors factorsOf(const glm::dmat3& m) {
  return {{m[0].x, m[1].x, m[2].x}, {m[0].y, m[1].y, m[2].y}, {m[0].z, m[1].z, m[2].z}};
}

CellShape shapeOf(const LqFactors& lq, double scale) {
  const Lower3& a = lq.lower;
  CellShape shape;
  shape.axis = {scale * a.a00, scale * a.a11, scale * a.a22};
  shape.shear = {a.a10 * lq.inverse_a00, a.a20 * lq.inverse_a00, a.a21 * lq.inverse_a11};
  for (int column = 0; column < 3; ++column) {
    glm::dvec3 unit(0.0);
    unit[column] = 1;
    shape.rotation[column] = lq.rotate(unit);
  }
  shape.determinant = lq.determinant * scale * scale * scale;
  shape.floored = false;
  return shape;
}

}  // namespace

CellShape shapeFromJacobian(const glm::dmat3& jacobian, double smallest) {
  const double scale = largestEntry(jacobian);
  if (!(scale > 0)) return {{smallest, smallest, smallest}, {0, 0, 0}, glm::dmat3(1.0), 0.0, true};

  // Scaled, no square leaves the range of double.
  glm::dmat3 unit = jacobian;
  for (int column = 0; column < 3; ++column) unit[column] /= scale;
  const LqFactors lq = factorsOf(unit);
  if (surelyAboveFloor(lq.lower)) return shapeOf(lq, scale);
  const Svd svd = decompose(unit);
  const double floor = kAxisFloor * svd.sigma[0];
  if (svd.sigma[2] >= floor) return shapeOf(lq, scale);

  glm::dmat3 raised(0.0);
  for (int n = 0; n < 3; ++n) raised += glm::outerProduct(std::max(svd.sigma[n], floor) * svd.u[n], svd.v[n]);
  CellShape shape = shapeOf(factorsOf(raised), scale);
  const bool singular = svd.sigma[2] <= kNoise * svd.sigma[0];
  const double volume = singular ? 0.0 : svd.sigma[0] * svd.sigma[1] * svd.sigma[2] * scale * scale * scale;
  shape.determinant = std::copysign(volume, shape.determinant);
  shape.floored = true;
  return shape;
}

void setShape(Splat& splat, const Symmetric3& s, double smallest) {
  // Cholesky where it is well conditioned.
  const double l10 = s.xy / s.xx, l20 = s.xz / s.xx;
  const double d1 = s.yy - l10 * s.xy;
  const double r21 = s.yz - l20 * s.xy;
  const double l21 = r21 / d1;
  const double d2 = s.zz - l20 * s.xz - l21 * r21;
  if (s.xx > 0 && d1 > 0 && d2 > 0) {
    const double a0 = std::sqrt(s.xx), a1 = std::sqrt(d1), a2 = std::sqrt(d2);
    if (surelyAboveFloor({a0, a0 * l10, a1, a0 * l20, a1 * l21, a2})) {
      splat.axis = {a0, a1, a2};
      splat.shear = {l10, l20, l21};
      return;
    }
  }

  // Else by the eigenvectors, S = V λ Vᵀ, so that a pivot which has cancelled does not turn the ellipsoid.
  const glm::dmat3 m(s.xx, s.xy, s.xz, s.xy, s.yy, s.yz, s.xz, s.yz, s.zz);
  const double scale = largestEntry(m);
  if (!(scale > 0)) {
    splat.axis = {smallest, smallest, smallest};
    splat.shear = {0, 0, 0};
    return;
  }
  glm::dmat3 unit = m;
  for (int column = 0; column < 3; ++column) unit[column] /= scale;
  const Svd svd = decompose(unit);
  const double floor = kAxisFloor * std::sqrt(svd.sigma[0]);
  glm::dmat3 columns;
  for (int n = 0; n < 3; ++n) columns[n] = std::max(std::sqrt(svd.sigma[n]), floor) * svd.v[n];
  const CellShape shape = shapeOf(factorsOf(columns), std::sqrt(scale));
  splat.axis = shape.axis;
  splat.shear = shape.shear;
}

glm::dvec3 inFrameOf(const Splat& splat, const glm::dvec3& v) {
  const auto& [l10, l20, l21] = splat.shear;
  const double u0 = v.x, u1 = v.y - l10 * u0, u2 = v.z - l20 * u0 - l21 * u1;
  return {u0 / splat.axis[0], u1 / splat.axis[1], u2 / splat.axis[2]};
}

glm::dvec3 gradientOf(const Splat& splat, const glm::dvec3& w) {
  const auto& [l10, l20, l21] = splat.shear;
  const double g2 = w.z / splat.axis[2];
  const double g1 = w.y / splat.axis[1] - l21 * g2;
  return {w.x / splat.axis[0] - l10 * g1 - l20 * g2, g1, g2};
}

Symmetric3 shapeMatrix(const Splat& splat) {
  const auto [a00, a11, a22] = splat.axis;
  const double a10 = a00 * splat.shear[0], a20 = a00 * splat.shear[1], a21 = a11 * splat.shear[2];
  return {a00 * a00,
          a10 * a00,
          a10 * a10 + a11 * a11,
          a20 * a00,
          a20 * a10 + a21 * a11,
          a20 * a20 + a21 * a21 + a22 * a22};
}

Symmetric3 raisedTo(const Symmetric3& s, double least) {
  Symmetric3 raised{least, 0, least, 0, 0, least};
  // No eigenvalue is above the norm.
  constexpr double kBelowOne = 1 - 1e-12;
  const double norm2 =
      s.xx * s.xx + s.yy * s.yy + s.zz * s.zz + 2 * (s.xy * s.xy + s.xz * s.xz + s.yz * s.yz);
  if (s.xx + s.yy + s.zz <= least || norm2 < kBelowOne * least * least) return raised;
  const double scale = 1 / std::max({s.xx, s.yy, s.zz});
  const Svd svd = decompose({scale * s.xx, scale * s.xy, scale * s.xz, scale * s.xy, scale * s.yy,
                             scale * s.yz, scale * s.xz, scale * s.yz, scale * s.zz});
  for (int n = 0; n < 3; ++n) {
    const double more = svd.sigma[n] / scale - least;
    if (!(more > 0)) break;
    const glm::dvec3& v = svd.v[n];
    raised.xx += more * v.x * v.x;
    raised.xy += more * v.x * v.y;
    raised.yy += more * v.y * v.y;
    raised.xz += more * v.x * v.z;
    raised.yz += more * v.y * v.z;
    raised.zz += more * v.z * v.z;
  }
  return raised;
}

std::array<double, 3> singularValues(const glm::dmat3& m) {
  const double scale = largestEntry(m);
  if (!(scale > 0)) return {0, 0, 0};
  glm::dmat3 unit = m;
  for (int column = 0; column < 3; ++column) unit[column] /= scale;
  const std::array<double, 3> sigma = decompose(unit).sigma;
  return {sigma[0] * scale, sigma[1] * scale, sigma[2] * scale};
}

}  // namespace curvisplat
