// A box along the mean faces of a hexahedron, which may be long, thin and slanted.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {

/// Between three pairs of parallel planes along a hexahedron's mean faces. Any thread may ask.
class SlantedBox {
 public:
  /// Holds the trilinear hexahedron, and every point that locateInHexahedron() finds in it. `corner` as Hexahedron takes them.
  explicit SlantedBox(const std::array<glm::dvec3, 8>& corner)
      : SlantedBox(corner, [&](const auto& visit) {
          for (const glm::dvec3& node : corner) visit(node);
        }) {}
  /// Along the faces of `corner`; holds the same of any hexahedron between the nodes, for each of which for_each_node(visit)
  /// calls visit(position). All numbers are finite.
  template <typename ForEachNode>
  SlantedBox(const std::array<glm::dvec3, 8>& corner, const ForEachNode& for_each_node);

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

template <typename ForEachNode>
SlantedBox::SlantedBox(const std::array<glm::dvec3, 8>& corner, const ForEachNode& for_each_node)
    : origin_(corner[0]) {
  const glm::dmat3 edges = Hexahedron(corner).jacobian;
  normals_ = {glm::cross(edges[1], edges[2]), glm::cross(edges[2], edges[0]), glm::cross(edges[0], edges[1])};
  glm::dvec3 largest(0.0);
  for_each_node([&](const glm::dvec3& node) {
    largest = glm::max(largest, glm::abs(node));
    for (size_t n = 0; n < 3; ++n) {
      const double at = glm::dot(normals_[n], node - origin_);
      lower_[n] = std::min(lower_[n], at);
      upper_[n] = std::max(upper_[n], at);
    }
  });
  for (size_t n = 0; n < 3; ++n) {
    // Newton's method ends within 1e-6 of an edge; the coordinates are rounded.
    constexpr double kNewton = 1e-5, kRounding = 100 * std::numeric_limits<double>::epsilon();
    const double margin =
        kNewton * (upper_[n] - lower_[n]) + kRounding * glm::dot(glm::abs(normals_[n]), largest);
    lower_[n] -= margin;
    upper_[n] += margin;
  }
}

}  // namespace curvisplat
