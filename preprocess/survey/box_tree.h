// A tree of axis-parallel boxes, which finds those that hold a point or touch a box.
//
// Building takes n log n, a query log n where few boxes overlap; both take less than 150 bytes a box.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {

/// Any thread may ask.
class BoxTree {
 public:
  /// Copies the boxes. Empty ones hold nothing.
  explicit BoxTree(std::span<const BoundingBox> boxes);

  /// Whether a box other than number `except` holds the point.
  bool anotherHolds(const glm::dvec3& point, uint32_t except) const;
  /// Whether a box other than number `except` has a point in common with this one.
  bool anotherTouches(const BoundingBox& box, uint32_t except) const;

 private:
  struct Numbered {
    BoundingBox bounds;
    uint32_t number;
    const BoundingBox& box() const { return bounds; }
    glm::dvec3 place() const { return bounds.lower + bounds.upper; }  // twice the centre: enough to sort by
  };
  static std::vector<Numbered> numbered(std::span<const BoundingBox> boxes);

  BoundingTree<Numbered> tree_;
};

}  // namespace curvisplat
