// Boxes, and balanced trees of what lies in them, for queries that pass over most of it: BoxTree finds the
// boxes that hold a point or touch a box, PointTree the points that may lie in a hexahedron. BoundingTree
// is the tree of both; a SlantedBox fits a long, thin and slanted cell, whose axis-parallel box is far too
// large.
//
// Building takes n log n, and 350 bytes a box at most or 50 bytes a point. A query takes log n where few
// boxes overlap. Trees are immutable: any thread may ask.
#pragma once

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/grid/hexahedron.h"

namespace curvisplat {

/// An axis-parallel box; empty until a point is added.
struct BoundingBox {
  glm::dvec3 lower{std::numeric_limits<double>::infinity()};
  glm::dvec3 upper{-std::numeric_limits<double>::infinity()};

  void add(const glm::dvec3& point) {
    lower = glm::min(lower, point);
    upper = glm::max(upper, point);
  }
  void add(const BoundingBox& other) {
    lower = glm::min(lower, other.lower);
    upper = glm::max(upper, other.upper);
  }
  bool isEmpty() const { return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z); }
  /// Whether they share more than a face.
  bool meets(const BoundingBox& other) const {
    for (int axis = 0; axis < 3; ++axis)
      if (!(lower[axis] < other.upper[axis] && other.lower[axis] < upper[axis])) return false;
    return true;
  }
  /// Whether they have a point in common.
  bool touches(const BoundingBox& other) const {
    for (int axis = 0; axis < 3; ++axis)
      if (!(lower[axis] <= other.upper[axis] && other.lower[axis] <= upper[axis])) return false;
    return true;
  }
  /// Points of the faces are held.
  bool holds(const glm::dvec3& point) const {
    for (int axis = 0; axis < 3; ++axis)
      if (!(lower[axis] <= point[axis] && point[axis] <= upper[axis])) return false;
    return true;
  }
};

/// A tree of items with box(), a BoundingBox or a point, and place(), a point to sort them by.
template <typename Item>
class BoundingTree {
 public:
  /// Up to `leaf_items` items share a leaf.
  BoundingTree(std::vector<Item> items, uint32_t leaf_items) : items_(std::move(items)) {
    if (!items_.empty()) build(0, static_cast<uint32_t>(items_.size()), leaf_items);
  }

  const std::vector<Item>& items() const { return items_; }

  /// Calls each(item) for the items of all leaves below boxes that enters(box) is true for, until one
  /// returns true. Returns whether one did.
  template <typename Enters, typename Each>
  bool visit(const Enters& enters, const Each& each) const {
    if (nodes_.empty()) return false;
    uint32_t stack[64];  // the tree is balanced: 32 levels at most
    size_t depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const uint32_t number = stack[--depth];
      const Node& node = nodes_[number];
      if (!enters(node.box)) continue;
      if (node.second != 0) {
        stack[depth++] = node.second;
        stack[depth++] = number + 1;
        continue;
      }
      for (uint32_t n = node.begin; n < node.end; ++n)
        if (each(items_[n])) return true;
    }
    return false;
  }

 private:
  struct Node {
    BoundingBox box;
    uint32_t begin = 0, end = 0;  // of items_
    uint32_t second = 0;          // the second child, the first being the next node; 0: a leaf
  };

  void build(uint32_t begin, uint32_t end, uint32_t leaf_items) {
    const size_t node = nodes_.size();
    nodes_.push_back({{}, begin, end, 0});
    BoundingBox places;
    for (uint32_t n = begin; n < end; ++n) {
      nodes_[node].box.add(items_[n].box());
      places.add(items_[n].place());
    }
    if (end - begin <= leaf_items) return;
    const glm::dvec3 extent = places.upper - places.lower;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(items_.begin() + begin, items_.begin() + middle, items_.begin() + end,
                     [axis](const Item& a, const Item& b) { return a.place()[axis] < b.place()[axis]; });
    build(begin, middle, leaf_items);
    nodes_[node].second = static_cast<uint32_t>(nodes_.size());
    build(middle, end, leaf_items);
  }

  std::vector<Item> items_;
  std::vector<Node> nodes_;  // parents before their children
};

/// A box between three pairs of parallel planes along the mean faces of a hexahedron, which may be long,
/// thin and slanted.
class SlantedBox {
 public:
  /// Holds the trilinear hexahedron, and every point that locateInHexahedron() finds in it. `corner` as
  /// Hexahedron takes them.
  explicit SlantedBox(const std::array<glm::dvec3, 8>& corner)
      : SlantedBox(corner, [&](const auto& visit) {
          for (const glm::dvec3& node : corner) visit(node);
        }) {}
  /// Bounds along the faces of `corner`; holds the same of any hexahedron between the nodes, for each of
  /// which for_each_node(visit) calls visit(position). All numbers are finite.
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

/// The bounds of something: in both boxes, if there are two.
struct Bounds {
  BoundingBox box;
  std::optional<SlantedBox> slanted;

  bool holds(const glm::dvec3& point) const {
    return box.holds(point) && (!slanted || slanted->holds(point));
  }
};

/// A tree of axis-parallel boxes, which finds those that hold a point or touch a box. A box may be cut to a
/// slanted one.
class BoxTree {
 public:
  /// Copies the boxes. Empty ones hold nothing.
  explicit BoxTree(std::span<const Bounds> boxes);

  /// Whether bounds other than number `except` hold the point.
  bool anotherHolds(const glm::dvec3& point, uint32_t except) const;
  /// Whether an axis-parallel box other than number `except` has a point in common with this one.
  bool anotherTouches(const BoundingBox& box, uint32_t except) const;

 private:
  struct Numbered {
    Bounds bounds;
    uint32_t number;
    const BoundingBox& box() const { return bounds.box; }
    glm::dvec3 place() const { return box().lower + box().upper; }  // twice the centre: enough to sort by
  };
  static std::vector<Numbered> numbered(std::span<const Bounds> boxes);

  BoundingTree<Numbered> tree_;
};

/// A tree of points, which finds those that may lie in a hexahedron, however long, thin and slanted it is.
/// A query visits the nodes of the tree near the hexahedron: those of its bounding box if they are few,
/// otherwise only those that its own slanted box touches as well.
class PointTree {
 public:
  /// Takes the points with these numbers, and copies them.
  template <typename Point>
  PointTree(std::span<const Point> points, std::span<const uint32_t> numbers)
      : tree_(numbered(points, numbers), kLeafPoints) {}

  size_t size() const { return tree_.items().size(); }

  /// Calls each(number) for all points that the hexahedron's bounding box and its slanted box hold; where
  /// they are few, for all points of the bounding box.
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
