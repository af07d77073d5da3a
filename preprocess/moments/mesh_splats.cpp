#include "preprocess/moments/mesh_splats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "preprocess/splats/shape.h"

namespace curvisplat {
namespace {

// A direction that the neighbours cover less than this, of the best covered one, has no slope.
constexpr double kLeastCover = 1e-3;

/// A length for the shape of a splat without any extent: far below the grid's, and above zero.
double smallestAxis(const glm::dvec3& centre) {
  const glm::dvec3 here = glm::abs(centre);
  const double length = std::max({here.x, here.y, here.z});
  return std::max(kAxisFloor * (length > 0 ? length : 1.0), std::numeric_limits<double>::min());
}

void setBody(uint64_t node, const glm::dvec3& centre, double volume, const Symmetric3& shape,
             NodeSplat& splat) {
  splat = {};
  splat.node = node;
  splat.splat.position = splat.node_position = centre;
  splat.splat.weight = volume;
  setShape(splat.splat, shape, smallestAxis(centre));
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations.
void eigenvectorsOf(std::array<std::array<double, 3>, 3>& a, std::array<std::array<double, 3>, 3>& v) {
  v = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int sweep = 0; sweep < 12; ++sweep) {
    if (!(a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2] > 1e-300)) return;
    for (size_t p = 0; p < 2; ++p)
      for (size_t q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (size_t k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (size_t k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
          const double vp = v[k][p], vq = v[k][q];
          v[k][p] = c * vp - s * vq;
          v[k][q] = s * vp + c * vq;
        }
      }
  }
}

}  // namespace

void splatOfPoint(uint64_t node, const DualCell& dual, NodeSplat& splat, std::span<SplatScalar> values) {
  const std::span<const double> m = dual.moments;
  const bool solid = m[0] > 0;
  const double share = solid ? 1 / m[0] : 0.0;
  const glm::dvec3 mean(share * m[1], share * m[2], share * m[3]);
  const auto shape = [&](size_t sum, int i, int j) { return 12 * (share * m[sum] - mean[i] * mean[j]); };
  setBody(node, dual.point + mean, m[0],
          {shape(4, 0, 0), shape(5, 0, 1), shape(6, 1, 1), shape(7, 0, 2), shape(8, 1, 2), shape(9, 2, 2)},
          splat);
  splat.node_position = dual.point;
  for (size_t field = 0; field < values.size(); ++field) {
    const double* of_field = m.data() + 10 + 5 * field;
    const double g = share * of_field[0];
    const glm::dvec3 h = 12.0 * (share * glm::dvec3(of_field[1], of_field[2], of_field[3]) - g * mean);
    const double variance = std::max(0.0, share * of_field[4] - g * g);
    // A slope never explains more than the variance there is; rounding, or a floored axis, may say so.
    glm::dvec3 slope = inFrameOf(splat.splat, h);
    const double explained = glm::dot(slope, slope) / 12;
    if (explained > variance) slope *= std::sqrt(variance / explained);
    values[field] = {dual.values[field] + g, slope, 0.0};
  }
}

void addNeighbour(const glm::dvec3& step, std::span<const float> neighbour, std::span<const float> own,
                  std::span<double> sums) {
  const double square = glm::dot(step, step);
  if (!(square > 0)) return;
  const glm::dvec3 d = step / square;
  sums[0] += d.x * step.x;
  sums[1] += d.x * step.y;
  sums[2] += d.y * step.y;
  sums[3] += d.x * step.z;
  sums[4] += d.y * step.z;
  sums[5] += d.z * step.z;
  for (size_t field = 0; field < own.size(); ++field) {
    const double difference = static_cast<double>(neighbour[field]) - own[field];
    for (int axis = 0; axis < 3; ++axis)
      sums[6 + 3 * field + static_cast<size_t>(axis)] += difference * d[axis];
  }
}

glm::dvec3 gradientOfSums(std::span<const double> sums, size_t field) {
  std::array<std::array<double, 3>, 3> a{
      {{sums[0], sums[1], sums[3]}, {sums[1], sums[2], sums[4]}, {sums[3], sums[4], sums[5]}}};
  std::array<std::array<double, 3>, 3> v;
  eigenvectorsOf(a, v);
  const double most = std::max({a[0][0], a[1][1], a[2][2]});
  const glm::dvec3 right(sums[6 + 3 * field], sums[7 + 3 * field], sums[8 + 3 * field]);
  glm::dvec3 gradient(0.0);
  for (size_t n = 0; n < 3; ++n) {
    if (!(a[n][n] > kLeastCover * most)) continue;
    const glm::dvec3 direction(v[0][n], v[1][n], v[2][n]);
    gradient += glm::dot(direction, right) / a[n][n] * direction;
  }
  return gradient;
}

void splatOfCell(uint64_t node, const CellBody& body, std::span<const float> cell_values,
                 std::span<const double> sums, NodeSplat& splat, std::span<SplatScalar> values) {
  setBody(node, body.centre, body.volume, {body.xx, body.xy, body.yy, body.xz, body.yz, body.zz}, splat);
  for (size_t field = 0; field < values.size(); ++field) {
    // Of h = S g, the slope A⁻¹ h is Aᵀ g.
    const glm::dvec3 slope = gradientOfSums(sums, field) * splat.splat.factor();
    values[field] = {cell_values[field], slope, 0.0};
  }
}

}  // namespace curvisplat
