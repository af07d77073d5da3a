// Points, and a tree that finds those that may lie in a hexahedron, however long, thin and slanted it is.
//
// Building takes n log n and 50 bytes a point. A query visits the nodes near the hexahedron: those of its bounding box if
// they are few, otherwise only those that its own slanted box touches as well.
#pragma once

#include <array>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/survey/box_tree.h"

namespace curvisplat {

/// Between three pairs of parallel planes along a hexahedron's mean faces. Holds the trilinear hexahedron, and every
/// point that locateInHexahedron() finds in it.
class SlantedBox {
 public:
  /// `corner` as Hexahedron takes them.
  explicit SlantedBox(const std::array<glm::dvec3, 8>& corner);

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
  std::array<glm::dvec3, 3> normals_;        // of any length; zero where the cell has no thickness
  std::array<double, 3> lower_{}, upper_{};  // along the normals, from the origin
};

/// Any thread may ask.
class PointTree {
 public:
  /// Of some of `points`, by number. Copies them.
  template <typename Point>
  PointTree(std::span<const Point> points, std::span<const uint32_t> numbers) {
    points_.reserve(numbers.size());
    for (const uint32_t n : numbers) points_.push_back({points[n].position, n});
    if (!points_.empty()) build(0, static_cast<uint32_t>(points_.size()));
  }

  size_t size() const { return points_.size(); }

  /// Calls each(number) for all points that the hexahedron's bounding box and its slanted box hold; where they are few,
  /// for all points of the bounding box.
  template <typename Each>
  void forEachNear(const std::array<glm::dvec3, 8>& corner, const Each& each) const;

  /// Calls each(number) for all points.
  template <typename Each>
  void forEach(const Each& each) const {
    for (const Numbered& point : points_) each(point.number);
  }

 private:
  struct Node {
    BoundingBox box;
    uint32_t begin = 0, end = 0;  // of points_
    uint32_t second = 0;          // the second child, the first being the next node; 0: a leaf
  };
  struct Numbered {
    glm::dvec3 position;
    uint32_t number;
  };

  void build(uint32_t begin, uint32_t end);

  std::vector<Numbered> points_;
  std::vector<Node> nodes_;  // parents before their children
};

template <typename Each>
void PointTree::forEachNear(const std::array<glm::dvec3, 8>& corner, const Each& each) const {
  if (nodes_.empty()) return;
  BoundingBox box;
  for (const glm::dvec3& node : corner) box.add(node);
  if (!nodes_[0].box.touches(box)) return;
  constexpr size_t kManyNodes = 32;  // from there on the slanted box pays
  std::optional<SlantedBox> slanted;
  size_t visited = 0;
  uint32_t stack[64];  // the tree is balanced: 32 levels at most
  size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t number = stack[--depth];
    const Node& node = nodes_[number];
    if (!node.box.touches(box)) continue;
    if (++visited == kManyNodes) slanted.emplace(corner);
    if (slanted && !slanted->mayTouch(node.box)) continue;
    if (node.second != 0) {
      stack[depth++] = node.second;
      stack[depth++] = number + 1;
      continue;
    }
    for (uint32_t n = node.begin; n < node.end; ++n)
      if (box.holds(points_[n].position) && (!slanted || slanted->holds(points_[n].position)))
        each(points_[n].number);
  }
}

}  // namespace curvisplat
