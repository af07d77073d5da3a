// The gradient of a field, from its differences along the three axes of a grid.
#pragma once

#include <array>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <utility>

namespace curvisplat {

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
  // A step whose relative distance from the span of the longer steps is below this adds only rounding errors.
  static constexpr double kFlat = 1e-7;

  std::array<int, 3> order_{0, 1, 2};  // axes, the longest step first
  std::array<glm::dvec3, 3> basis_;    // orthonormal (Gram-Schmidt); 0 where a step adds no direction
  std::array<double, 3> inverse_;      // 1 / length of the step's component along its basis vector
  double along_[3][3];                 // [n][m]: component of step m along basis_[n], n < m
};

}  // namespace curvisplat
