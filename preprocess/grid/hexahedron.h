// The trilinear hexahedron between eight nodes: its centre, its Jacobian there, and its volume.
#pragma once

#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

namespace curvisplat {

/// Built from the corners, whose index has bit 1 along i, 2 along j, 4 along k. Inline, since conversion does
/// this for every cell.
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

}  // namespace curvisplat
