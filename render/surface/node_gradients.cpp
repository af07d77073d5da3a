#include "render/surface/node_gradients.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <span>

namespace curvisplat {
namespace {

/// How places and values change along an axis of a block, by the same parameter.
struct Derivative {
  glm::dvec3 place{0.0};
  double value = 0;
};

/// The derivative, by length, at the first of three nodes, of the parabola through them. `to`: the two others from there, on the same side
/// or on either; `length`: how far they are along the line, with a sign. Two of them may be at one place.
Derivative ofParabola(const std::array<Derivative, 2>& to, const std::array<double, 2>& length) {
  const double a = length[0], b = length[1];
  double of_a = 0, of_b = 0;
  if (a == 0 && b != 0)
    of_b = 1 / b;
  else if (a != 0 && (b == 0 || a == b))
    of_a = 1 / a;
  else if (a != 0)
    of_a = b / (a * (b - a)), of_b = -a / (b * (b - a));
  return {of_a * to[0].place + of_b * to[1].place, of_a * to[0].value + of_b * to[1].value};
}

// A place of more nodes is a pole, where the grid has collapsed: none of them knows a gradient.
constexpr std::ptrdiff_t kMaxShared = 64;

}  // namespace

NodeGradients::NodeGradients(const GridNodes& nodes) : nodes_(nodes) {
  const std::span<const JoinedNode> joined = nodes.joined();
  if (joined.empty()) return;
  same_.resize(nodes.size());
  std::iota(same_.begin(), same_.end(), 0u);
  for (const auto& [node, same] : joined) same_[node] = same;
  by_same_.assign(joined.begin(), joined.end());
  std::stable_sort(by_same_.begin(), by_same_.end(),
                   [](const JoinedNode& a, const JoinedNode& b) { return a.same < b.same; });
}

bool NodeGradients::isShared(size_t node) const {
  if (same_.empty()) return false;
  return same_[node] != node ||
         std::binary_search(by_same_.begin(), by_same_.end(), JoinedNode{0, static_cast<uint32_t>(node)},
                            [](const JoinedNode& a, const JoinedNode& b) { return a.same < b.same; });
}

glm::dvec3 NodeGradients::at(size_t node) const {
  const size_t one = representative(node);
  auto other = std::lower_bound(by_same_.begin(), by_same_.end(), one,
                                [](const JoinedNode& joined, size_t same) { return joined.same < same; });
  const auto end = std::upper_bound(other, by_same_.end(), one,
                                    [](size_t same, const JoinedNode& joined) { return same < joined.same; });
  if (end - other > kMaxShared) return glm::dvec3(0.0);
  Weighted sum = ofOne(one);
  for (; other != end; ++other) {
    const Weighted of_other = ofOne(other->node);
    sum.gradient += of_other.gradient;
    sum.weight += of_other.weight;
  }
  const glm::dvec3 gradient = sum.gradient / sum.weight;
  return std::isfinite(glm::length(gradient)) ? gradient : glm::dvec3(0.0);
}

NodeGradients::Weighted NodeGradients::ofOne(size_t node) const {
  const auto& blocks = nodes_.blocks();
  const auto after =
      std::upper_bound(blocks.begin(), blocks.end(), node,
                       [](size_t n, const GridNodes::Block& block) { return n < block.first; });
  const GridNodes::Block& block = *(after - 1);
  const glm::dvec3 here(nodes_.position(node));
  const auto from_here = [&](size_t other) {
    return Derivative{glm::dvec3(nodes_.position(other)) - here,
                      double{nodes_.value(other)} - double{nodes_.value(node)}};
  };
  const GridNodes::OfAxes beside = nodes_.neighbours(block, node);
  std::array<Derivative, 3> along;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto& [before, after] = beside[axis];
    if (beside[axis].areBoth(node)) {
      const std::array to{from_here(before), from_here(after)};
      along[axis] = ofParabola(to, {-glm::length(to[0].place), glm::length(to[1].place)});
      continue;
    }
    if (before == after) continue;  // nothing beside it
    const bool backwards = beside[axis].hasBefore(node);
    const size_t next = backwards ? before : after;
    const auto beyond = nodes_.neighbours(block, next)[axis];
    const double sign = backwards ? -1 : 1;  // blocks are passed through in one direction
    const Derivative first = from_here(next);
    const Derivative second = from_here(backwards ? beyond.before : beyond.after);
    const double a = glm::length(first.place), b = a + glm::length(second.place - first.place);
    along[axis] = ofParabola({first, second}, {sign * a, sign * b});
  }
  const auto& [i, j, k] = along;
  const glm::dvec3 across_i = glm::cross(j.place, k.place), across_j = glm::cross(k.place, i.place),
                   across_k = glm::cross(i.place, j.place);
  const double weight = glm::dot(i.place, across_i);
  const glm::dvec3 gradient = i.value * across_i + j.value * across_j + k.value * across_k;
  return weight < 0 ? Weighted{-gradient, -weight} : Weighted{gradient, weight};
}

}  // namespace curvisplat
