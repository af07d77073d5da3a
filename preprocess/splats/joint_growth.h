// How cells grow across a joint of blocks. A node's half cells on either side of it know their own blocks alone; the cell that they
// are merged to is skewed, and lies beside its middle, as it would if its block had never been cut (stretch.h).
//
// Across a joint, the growth from one cell to the next is the mean of what the halves expect, from their own lines, and
// of what their thicknesses say, ln b/a. Of cells that grow steadily both are the growth; at a jump of sizes, between blocks
// of even cells, half of its logarithm, as elsewhere in a block. Blocks of too few nodes to show growth expect none.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/splats/node_splats.h"

namespace curvisplat {

class JointGrowth {
 public:
  void add(const NodeSplat& part);

  struct Found {
    uint32_t code = kNoGrowth;
    glm::dvec3 drift{0.0};  // in the frame of the merged splat
  };
  /// Of the splat that the parts were merged into, of which `lowest` is one.
  Found of(const Splat& merged, const NodeSplat& lowest) const;

 private:
  /// A half cell, along an axis on which it ends.
  struct Half {
    glm::dvec3 along;  // inwards, world units, as long as the half
    double growth;     // inwards
  };
  double across(const Splat& merged, const glm::dvec3& axis) const;

  std::vector<Half> halves_;
};

}  // namespace curvisplat
