#include "preprocess/grid/hexahedron.h"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <cstddef>

namespace curvisplat {

std::optional<glm::dvec3> locateInHexahedron(const std::array<glm::dvec3, 8>& corner,
                                             const glm::dvec3& point) {
  glm::dvec3 u(0.0);
  constexpr int kSteps = 12;
  for (int step = 0; step < kSteps; ++step) {
    glm::dvec3 at(0.0);
    glm::dmat3 jacobian(0.0);
    for (int c = 0; c < 8; ++c) {
      const glm::dvec3 side(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
      const glm::dvec3 weight = 0.5 * (1.0 + side * u);
      const glm::dvec3& node = corner[static_cast<size_t>(c)];
      at += weight.x * weight.y * weight.z * node;
      jacobian[0] += 0.5 * side.x * weight.y * weight.z * node;
      jacobian[1] += 0.5 * side.y * weight.x * weight.z * node;
      jacobian[2] += 0.5 * side.z * weight.x * weight.y * node;
    }
    const double determinant = glm::determinant(jacobian);
    if (determinant == 0) return std::nullopt;
    const glm::dvec3 change = glm::inverse(jacobian) * (point - at);
    u += change;
    const double size = glm::length(change);
    if (!(size < 1e3)) return std::nullopt;
    if (size < 1e-6) return u;
  }
  return std::nullopt;
}

}  // namespace curvisplat
