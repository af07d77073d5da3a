#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {
namespace {

constexpr uint32_t kLeafBoxes = 4;

}  // namespace

BoxTree::BoxTree(std::span<const Bounds> boxes) : tree_(numbered(boxes), kLeafBoxes) {}

std::vector<BoxTree::Numbered> BoxTree::numbered(std::span<const Bounds> boxes) {
  std::vector<Numbered> out;
  for (uint32_t n = 0; n < boxes.size(); ++n)
    if (!boxes[n].box.isEmpty()) out.push_back({boxes[n], n});
  return out;
}

bool BoxTree::anotherHolds(const glm::dvec3& point, uint32_t except) const {
  return tree_.visit([&](const BoundingBox& box) { return box.holds(point); },
                     [&](const Numbered& box) { return box.number != except && box.bounds.holds(point); });
}

bool BoxTree::anotherTouches(const BoundingBox& box, uint32_t except) const {
  if (box.isEmpty()) return false;
  return tree_.visit(
      [&](const BoundingBox& node) { return node.touches(box); },
      [&](const Numbered& other) { return other.number != except && other.box().touches(box); });
}

}  // namespace curvisplat
