// Axis-parallel boxes, and a balanced tree of what lies in them, for queries that pass over most of it.
//
// Building takes n log n.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace curvisplat {

/// Empty until a point is added.
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

/// Of items with box(), a BoundingBox or a point, and place(), a point to sort them by. Any thread may ask.
template <typename Item>
class BoundingTree {
 public:
  /// Up to `leaf_items` items share a leaf.
  BoundingTree(std::vector<Item> items, uint32_t leaf_items) : items_(std::move(items)) {
    if (!items_.empty()) build(0, static_cast<uint32_t>(items_.size()), leaf_items);
  }

  const std::vector<Item>& items() const { return items_; }

  /// Calls each(item) for the items of all leaves below boxes that enters(box) is true for, until one returns true. Returns
  /// whether one did.
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

}  // namespace curvisplat
