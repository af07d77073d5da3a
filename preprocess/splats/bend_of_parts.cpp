#include "preprocess/splats/bend_of_parts.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "preprocess/splats/node_splats.h"
#include "preprocess/splats/shape.h"

namespace curvisplat {

void BendOfParts::add(const Splat& splat, const glm::dvec3& offset, std::span<const SplatScalar> values) {
  weight_ += splat.weight;
  middle_ += splat.weight * offset;
  for (size_t v = 0; v < sums_.size(); ++v) {
    const glm::dvec3 gradient = gradientOf(splat, values[v].slope);
    sums_[v].along += splat.weight * glm::dot(gradient, offset);
    sums_[v].gradient += splat.weight * gradient;
  }
}

void BendOfParts::correct(std::span<SplatScalar> merged) const {
  if (!(weight_ > 0)) return;
  for (size_t v = 0; v < sums_.size(); ++v) {
    // Two halves, with a scalar's second difference b: b / 8, and b² / 192 is what they add to the variance.
    const double eighth = (sums_[v].along - glm::dot(sums_[v].gradient, middle_) / weight_) / weight_;
    merged[v].mean -= (1 - 8 * kBend) * eighth;
    merged[v].variance = std::max(0.0, merged[v].variance - eighth * eighth / 3);
  }
}

}  // namespace curvisplat
