// Geometry of a cell of a curvilinear grid: the trilinear hexahedron between eight nodes (its centre, its
// Jacobian there, its volume), where a point lies in it, and the gradient of a field from its differences
// along the axes of the grid. Pure: any thread. What conversion computes for every cell or node is inline.
#pragma once

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <utility>

namespace curvisplat {

/// Built from the corners, whose index has bit 1 along i, 2 along j, 4 along k. Inline, since conversion
/// does this for every cell.
struct Hexahedron {
  glm::dvec3 centre;    // the mean of the corners
  glm::dmat3 jacobian;  // at the centre; columns along i, j, k: each is the mean of four edges
  /// Volume minus det(jacobian); 0 for a parallelepiped. Exact: the closed-form integral of the trilinear
  /// map's Jacobian, in which only the twists e (ij), f (jk) and g (ki) contribute.
  double volume_beyond;

  explicit Hexahedron(const std::array<glm::dvec3, 8>& corner) {
    const glm::dvec3 s0 = corner[0] + corner[1], d0 = corner[1] - corner[0];
    const glm::dvec3 s1 = corner[2] + corner[3], d1 = corner[3] - corner[2];
    const glm::dvec3 s2 = corner[4] + corner[5], d2 = corner[5] - corner[4];
    const glm::dvec3 s3 = corner[6] + corner[7], d3 = corner[7] - corner[6];
    centre = 0.125 * ((s0 + s1) + (s2 + s3));
    jacobian[0] = 0.25 * ((d0 + d1) + (d2 + d3));
    jacobian[1] = 0.25 * ((s1 - s0) + (s3 - s2));
    jacobian[2] = 0.25 * ((s2 - s0) + (s3 - s1));
    const glm::dvec3 e = (d1 - d0) + (d3 - d2);
    const glm::dvec3 f = (s3 - s2) - (s1 - s0);
    const glm::dvec3 g = (d2 - d0) + (d3 - d1);
    volume_beyond = (triple(e, jacobian[1], f) + triple(jacobian[0], e, g) + triple(g, f, jacobian[2])) / 48;
  }

  /// Signed: negative if the corners are left-handed.
  double volume() const { return triple(jacobian[0], jacobian[1], jacobian[2]) + volume_beyond; }

  static double triple(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    return glm::dot(a, glm::cross(b, c));
  }
};

/// The corners of the cell whose lowest node is element `at` of the arrays.
inline std::array<glm::dvec3, 8> cornersAt(const double* x, const double* y, const double* z, size_t at,
                                           size_t row_stride, size_t plane_stride) {
  std::array<glm::dvec3, 8> corner;
  for (size_t c = 0; c < 8; ++c) {
    const size_t n = at + (c & 1) + (c >> 1 & 1) * row_stride + (c >> 2) * plane_stride;
    corner[c] = {x[n], y[n], z[n]};
  }
  return corner;
}

/// The bitwise or of the marks of the eight corners.
inline uint8_t cornerMarks(const uint8_t* marks, size_t at, size_t row_stride, size_t plane_stride) {
  const uint8_t* p = marks + at;
  const auto pair = [](const uint8_t* q) { return static_cast<uint8_t>(q[0] | q[1]); };
  return static_cast<uint8_t>(pair(p) | pair(p + row_stride) | pair(p + plane_stride) |
                              pair(p + row_stride + plane_stride));
}

/// The hexahedron's local coordinates of a point: -1 to 1 along i, j, k inside it, beyond that outside. By
/// Newton's method; nullopt where that does not converge: far outside, or in a cell without volume. `corner`
/// as Hexahedron takes them.
std::optional<glm::dvec3> locateInHexahedron(const std::array<glm::dvec3, 8>& corner,
                                             const glm::dvec3& point);

/// The gradient of the linear field with the given differences over the given steps. If the steps lie in a
/// plane or on a line (polar axes, sheets), the field is taken as constant across it. Inline, since it is
/// computed for every node.
class LatticeGradient {
 public:
  /// Columns: from one neighbour to the other along i, j, k; zero where there are no neighbours.
  explicit LatticeGradient(const glm::dmat3& steps) {
    std::array<double, 3> length;
    for (int axis = 0; axis < 3; ++axis) length[axis] = glm::length(steps[axis]);
    if (length[order_[0]] < length[order_[1]]) std::swap(order_[0], order_[1]);
    if (length[order_[1]] < length[order_[2]]) std::swap(order_[1], order_[2]);
    if (length[order_[0]] < length[order_[1]]) std::swap(order_[0], order_[1]);
    for (int m = 0; m < 3; ++m) {
      glm::dvec3 rest = steps[order_[m]];
      for (int n = 0; n < m; ++n) {
        along_[n][m] = glm::dot(basis_[n], rest);
        rest -= along_[n][m] * basis_[n];
      }
      const double across = glm::length(rest);
      const bool counts = across > kFlat * length[order_[m]];
      basis_[m] = counts ? rest / across : glm::dvec3(0.0);
      inverse_[m] = counts ? 1 / across : 0.0;
    }
  }

  glm::dvec3 operator()(const glm::dvec3& differences) const {
    glm::dvec3 gradient(0.0);
    std::array<double, 3> part;
    for (int m = 0; m < 3; ++m) {
      part[m] = differences[order_[m]];
      for (int n = 0; n < m; ++n) part[m] -= along_[n][m] * part[n];
      part[m] *= inverse_[m];
      gradient += part[m] * basis_[m];
    }
    return gradient;
  }

 private:
  // A step whose relative distance from the span of the longer steps is below this adds only rounding
  // errors.
  static constexpr double kFlat = 1e-7;

  std::array<int, 3> order_{0, 1, 2};  // axes, the longest step first
  std::array<glm::dvec3, 3> basis_;    // orthonormal (Gram-Schmidt); 0 where a step adds no direction
  std::array<double, 3> inverse_;      // 1 / length of the step's component along its basis vector
  double along_[3][3];                 // [n][m]: component of step m along basis_[n], n < m
};

}  // namespace curvisplat
