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

#include "preprocess/survey/bounding_tree.h"

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
  PointTree(std::span<const Point> points, std::span<const uint32_t> numbers)
      : tree_(numbered(points, numbers), kLeafPoints) {}

  size_t size() const { return tree_.items().size(); }

  /// Calls each(number) for all points that the hexahedron's bounding box and its slanted box hold; where they are few,
  /// for all points of the bounding box.
  template <typename Each>
  void forEachNear(const std::array<glm::dvec3, 8>& corner, const Each& each) const;

  /// Whether is(number) is true for a point that the box holds.
  template <typename Is>
  bool anyIn(const BoundingBox& box, const Is& is) const {
    return tree_.visit([&](const BoundingBox& node) { return node.touches(box); },
                       [&](const Numbered& point) { return box.holds(point.position) && is(point.number); });
  }

  /// Calls each(number) for all points.
  template <typename Each>
  void forEach(const Each& each) const {
    for (const Numbered& point : tree_.items()) each(point.number);
  }

 private:
  static constexpr uint32_t kLeafPoints = 8;
  struct Numbered {
    glm::dvec3 position;
    uint32_t number;
    const glm::dvec3& box() const { return position; }
    const glm::dvec3& place() const { return position; }
  };
  template <typename Point>
  static std::vector<Numbered> numbered(std::span<const Point> points, std::span<const uint32_t> numbers) {
    std::vector<Numbered> out;
    out.reserve(numbers.size());
    for (const uint32_t n : numbers) out.push_back({points[n].position, n});
    return out;
  }

  BoundingTree<Numbered> tree_;
};

template <typename Each>
void PointTree::forEachNear(const std::array<glm::dvec3, 8>& corner, const Each& each) const {
  BoundingBox box;
  for (const glm::dvec3& node : corner) box.add(node);
  constexpr size_t kManyNodes = 32;  // from there on the slanted box pays
  std::optional<SlantedBox> slanted;
  size_t visited = 0;
  tree_.visit(
      [&](const BoundingBox& node) {
        if (!node.touches(box)) return false;
        if (++visited == kManyNodes) slanted.emplace(corner);
        return !slanted || slanted->mayTouch(node);
      },
      [&](const Numbered& point) {
        if (box.holds(point.position) && (!slanted || slanted->holds(point.position))) each(point.number);
        return false;
      });
}

}  // namespace curvisplat
