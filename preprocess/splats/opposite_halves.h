// Which halves of coincident nodes lie opposite to one another, across a joint.
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "preprocess/splats/node_splats.h"
#include "preprocess/splats/shape.h"
#include "stream/model/border_code.h"

namespace curvisplat {

/// Calls visit(n, m, cosine) for the directions n of a's border code that are opposite to directions m of b's; -1 is the cosine of
/// those on one line.
template <typename Visit>
void forEachOpposite(const NodeSplat& a, const NodeSplat& b, const Visit& visit) {
  constexpr double kOpposite = -0.5;  // cosine of two directions, in the frame of a cell
  const InwardAxes of_a = inwardAxes(a.border_code), of_b = inwardAxes(b.border_code);
  for (int n = 0; n < of_a.count; ++n)
    for (int m = 0; m < of_b.count; ++m) {
      const glm::dvec3 inward(of_a.axis[static_cast<size_t>(n)]), other(of_b.axis[static_cast<size_t>(m)]);
      const glm::dvec3 seen = inFrameOf(a.splat, b.splat.factor() * other);
      const double cosine = glm::dot(inward, seen) / glm::length(seen);
      if (!(cosine > kOpposite)) visit(n, m, cosine);
    }
}

}  // namespace curvisplat
