// The means of a cell that is merged of its parts, corrected for how the scalars bend between them.
#pragma once

#include <algorithm>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "stream/model/splats.h"

namespace curvisplat {

/// How the scalars bend from one part of a node's cell to another, once the node is whole again. A half cell
/// knows no second difference along its short axis (node_splats.h), and its parts' means make an eighth of it
/// where a tenth is right; the rest is taken off, and so is the variance that is this bend's alone. The node
/// is then as if its block had never been cut.
class BendOfParts {
 public:
  explicit BendOfParts(size_t variables) : sums_(variables) {}

  void clear() {
    weight_ = 0;
    middle_ = glm::dvec3(0.0);
    std::fill(sums_.begin(), sums_.end(), Sums());
  }
  /// `offset`: of the part's middle, from any point that is common to all.
  void add(const Splat& splat, const glm::dvec3& offset, std::span<const SplatScalar> values);
  void correct(std::span<SplatScalar> merged) const;

 private:
  struct Sums {
    double along = 0;
    glm::dvec3 gradient{0.0};
  };
  double weight_ = 0;
  glm::dvec3 middle_{0.0};
  std::vector<Sums> sums_;
};

}  // namespace curvisplat
