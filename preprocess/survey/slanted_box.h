// A box along the mean faces of a hexahedron, which may be long, thin and slanted.
#pragma once

#include <array>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {

/// Between three pairs of parallel planes along a hexahedron's mean faces. Any thread may ask.
class SlantedBox {
 public:
  /// Holds the trilinear hexahedron, and every point that locateInHexahedron() finds in it. `corner` as Hexahedron takes them.
  explicit SlantedBox(const std::array<glm::dvec3, 8>& corner) : SlantedBox(corner, corner) {}
  /// Along the faces of `corner`; holds the same of any hexahedron between `nodes`, which have all numbers finite.
  SlantedBox(const std::array<glm::dvec3, 8>& corner, std::span<const glm::dvec3> nodes);

  bool holds(const glm::dvec3& point) const {
    const glm::dvec3 from = point - origin_;
    for (size_t n = 0; n < 3; ++n) {
      const double at = glm::dot(normals_[n], from);
      if (at < lower_[n] || at > upper_[n]) return false;
    }
    return true;
  }
  /// Whether the box may touch this one: not if a pair of planes separates them.
  bool mayTouch(const BoundingBox& box) const {
    const glm::dvec3 from = 0.5 * (box.lower + box.upper) - origin_, half = 0.5 * (box.upper - box.lower);
    for (size_t n = 0; n < 3; ++n) {
      const double at = glm::dot(normals_[n], from), reach = glm::dot(glm::abs(normals_[n]), half);
      if (at + reach < lower_[n] || at - reach > upper_[n]) return false;
    }
    return true;
  }

 private:
  glm::dvec3 origin_;
  std::array<glm::dvec3, 3> normals_;        // of any length; zero where the hexahedron has no thickness
  std::array<double, 3> lower_{}, upper_{};  // along the normals, from the origin
};

}  // namespace curvisplat
