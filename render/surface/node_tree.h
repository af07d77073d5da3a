// Points that boxes are asked for: a k-d tree in an array, whose middle element parts the others along x, y and z in turn. A search for few
// points takes about the logarithm of their number, however many of them lie in a plane.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <utility>
#include <vector>

namespace curvisplat {

class NodeTree {
 public:
  struct Point {
    glm::dvec3 at;
    uint32_t number;
  };
  static constexpr size_t kPointBytes = sizeof(Point);

  NodeTree() = default;
  explicit NodeTree(std::vector<Point> points) : points_(std::move(points)) {
    sort(points_.begin(), points_.end(), 0);
  }

  /// Calls use(point) for those in a box, in the same order whenever it is asked. Returns how many it looked at.
  template <typename Use>
  uint64_t forBox(const glm::dvec3& lower, const glm::dvec3& upper, const Use& use) const {
    return search(points_.begin(), points_.end(), 0, lower, upper, use);
  }

 private:
  using Points = std::vector<Point>;

  void sort(Points::iterator begin, Points::iterator end, int axis) {
    if (end - begin < 2) return;
    const auto middle = begin + (end - begin) / 2;
    std::nth_element(begin, middle, end, [axis](const Point& a, const Point& b) {
      return std::pair(a.at[axis], a.number) < std::pair(b.at[axis], b.number);
    });
    sort(begin, middle, (axis + 1) % 3);
    sort(middle + 1, end, (axis + 1) % 3);
  }
  template <typename Use>
  static uint64_t search(Points::const_iterator begin, Points::const_iterator end, int axis,
                         const glm::dvec3& lower, const glm::dvec3& upper, const Use& use) {
    if (begin == end) return 0;
    const auto middle = begin + (end - begin) / 2;
    const glm::dvec3 at = middle->at;
    if (glm::all(glm::lessThanEqual(lower, at)) && glm::all(glm::lessThanEqual(at, upper))) use(*middle);
    uint64_t seen = 1;
    if (lower[axis] <= at[axis]) seen += search(begin, middle, (axis + 1) % 3, lower, upper, use);
    if (upper[axis] >= at[axis]) seen += search(middle + 1, end, (axis + 1) % 3, lower, upper, use);
    return seen;
  }

  Points points_;
};

}  // namespace curvisplat
