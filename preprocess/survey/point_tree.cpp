#include "preprocess/survey/point_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "preprocess/grid/hexahedron.h"

namespace curvisplat {
namespace {

constexpr uint32_t kLeafPoints = 8;

}  // namespace

SlantedBox::SlantedBox(const std::array<glm::dvec3, 8>& corner) : origin_(corner[0]) {
  const glm::dmat3 edges = Hexahedron(corner).jacobian;
  normals_ = {glm::cross(edges[1], edges[2]), glm::cross(edges[2], edges[0]), glm::cross(edges[0], edges[1])};
  glm::dvec3 largest(0.0);
  for (const glm::dvec3& node : corner) largest = glm::max(largest, glm::abs(node));
  for (size_t n = 0; n < 3; ++n) {
    for (const glm::dvec3& node : corner) {
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

void PointTree::build(uint32_t begin, uint32_t end) {
  const size_t node = nodes_.size();
  nodes_.push_back({{}, begin, end, 0});
  for (uint32_t n = begin; n < end; ++n) nodes_[node].box.add(points_[n].position);
  if (end - begin <= kLeafPoints) return;
  const glm::dvec3 extent = nodes_[node].box.upper - nodes_[node].box.lower;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(
      points_.begin() + begin, points_.begin() + middle, points_.begin() + end,
      [axis](const Numbered& a, const Numbered& b) { return a.position[axis] < b.position[axis]; });
  build(begin, middle);
  nodes_[node].second = static_cast<uint32_t>(nodes_.size());
  build(middle, end);
}

}  // namespace curvisplat
