#include "preprocess/survey/slanted_box.h"

#include <algorithm>
#include <limits>

#include "preprocess/grid/hexahedron.h"

namespace curvisplat {

SlantedBox::SlantedBox(const std::array<glm::dvec3, 8>& corner, std::span<const glm::dvec3> nodes)
    : origin_(corner[0]) {
  const glm::dmat3 edges = Hexahedron(corner).jacobian;
  normals_ = {glm::cross(edges[1], edges[2]), glm::cross(edges[2], edges[0]), glm::cross(edges[0], edges[1])};
  glm::dvec3 largest(0.0);
  for (const glm::dvec3& node : nodes) largest = glm::max(largest, glm::abs(node));
  for (size_t n = 0; n < 3; ++n) {
    for (const glm::dvec3& node : nodes) {
      const double at = glm::dot(normals_[n], node - origin_);
      lower_[n] = std::min(lower_[n], at);
      upper_[n] = std::max(upper_[n], at);
    }
    // Newton's method ends within 1e-6 of an edge; the coordinates are rounded.
    constexpr double kNewton = 1e-5, kRounding = 100 * std::numeric_limits<double>::epsilon();
    const double margin =
        kNewton * (upper_[n] - lower_[n]) + kRounding * glm::dot(glm::abs(normals_[n]), largest);
    lower_[n] -= margin;
    upper_[n] += margin;
  }
}

}  // namespace curvisplat
