#include "preprocess/survey/box_tree.h"

#include <algorithm>

namespace curvisplat {
namespace {

constexpr uint32_t kLeafBoxes = 4;

/// Twice the centre of a box: enough to sort by.
glm::dvec3 centreOf(const BoundingBox& box) {
  return box.lower + box.upper;
}

}  // namespace

BoxTree::BoxTree(std::span<const BoundingBox> boxes) {
  for (uint32_t n = 0; n < boxes.size(); ++n)
    if (!boxes[n].isEmpty()) boxes_.push_back({boxes[n], n});
  if (!boxes_.empty()) build(0, static_cast<uint32_t>(boxes_.size()));
}

void BoxTree::build(uint32_t begin, uint32_t end) {
  const size_t node = nodes_.size();
  nodes_.push_back({{}, begin, end, 0});
  BoundingBox centres;
  for (uint32_t n = begin; n < end; ++n) {
    nodes_[node].box.add(boxes_[n].box);
    centres.add(centreOf(boxes_[n].box));
  }
  if (end - begin <= kLeafBoxes) return;
  const glm::dvec3 extent = centres.upper - centres.lower;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(
      boxes_.begin() + begin, boxes_.begin() + middle, boxes_.begin() + end,
      [axis](const Numbered& a, const Numbered& b) { return centreOf(a.box)[axis] < centreOf(b.box)[axis]; });
  build(begin, middle);
  nodes_[node].second = static_cast<uint32_t>(nodes_.size());
  build(middle, end);
}

bool BoxTree::anotherHolds(const glm::dvec3& point, uint32_t except) const {
  if (nodes_.empty()) return false;
  uint32_t stack[64];  // the tree is balanced: 32 levels at most
  size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t number = stack[--depth];
    const Node& node = nodes_[number];
    if (!node.box.holds(point)) continue;
    if (node.second != 0) {
      stack[depth++] = node.second;
      stack[depth++] = number + 1;
      continue;
    }
    for (uint32_t n = node.begin; n < node.end; ++n)
      if (boxes_[n].number != except && boxes_[n].box.holds(point)) return true;
  }
  return false;
}

}  // namespace curvisplat
