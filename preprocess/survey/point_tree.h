// Points, and a tree that finds those that may lie in a hexahedron, however long, thin and slanted it is.
//
// Building takes n log n and 50 bytes a point. A query visits the nodes near the hexahedron: those of its bounding box if
// they are few, otherwise only those that its own slanted box touches as well.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/survey/bounding_tree.h"
#include "preprocess/survey/slanted_box.h"

namespace curvisplat {

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
