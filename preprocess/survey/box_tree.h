// Axis-parallel boxes, and a tree that finds those that hold a point.
//
// Building takes n log n, a query log n where few boxes overlap; both take less than 150 bytes a box.
#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
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

/// Any thread may ask.
class BoxTree {
 public:
  /// Copies the boxes. Empty ones hold nothing.
  explicit BoxTree(std::span<const BoundingBox> boxes);

  /// Whether a box other than number `except` holds the point.
  bool anotherHolds(const glm::dvec3& point, uint32_t except) const;

 private:
  struct Node {
    BoundingBox box;
    uint32_t begin = 0, end = 0;  // of boxes_
    uint32_t second = 0;          // the second child, the first being the next node; 0: a leaf
  };
  struct Numbered {
    BoundingBox box;
    uint32_t number;
  };

  void build(uint32_t begin, uint32_t end);

  std::vector<Numbered> boxes_;
  std::vector<Node> nodes_;  // parents before their children
};

}  // namespace curvisplat
