// A tree of axis-parallel boxes, which finds those that hold a point or touch a box. A box may be cut to a slanted one.
//
// Building takes n log n, a query log n where few boxes overlap; both take less than 350 bytes a box.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/survey/bounding_tree.h"
#include "preprocess/survey/slanted_box.h"

namespace curvisplat {

/// Where something lies: in both boxes, if there are two.
struct Bounds {
  BoundingBox box;
  std::optional<SlantedBox> slanted;

  bool holds(const glm::dvec3& point) const {
    return box.holds(point) && (!slanted || slanted->holds(point));
  }
};

/// Any thread may ask.
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

}  // namespace curvisplat
