// Lengthens a node's splat along axes of the lattice, and skews and shifts it there: what a joint of blocks adds to what its block
// knew of it (joint_line.h).
#pragma once

#include <array>
#include <cstddef>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// Up to three axes at right angles, with the growth along each.
class GrownAxes {
 public:
  /// `axis`: unit length. Takes out what it has of those before; adds nothing if too little is left.
  void add(const glm::dvec3& axis, double growth);
  uint32_t code() const { return count_ > 0 ? packGrowthCode(axes_, growth_) : kNoGrowth; }

 private:
  std::array<glm::dvec3, 3> axes_{};
  std::array<double, 3> growth_{};
  size_t count_ = 0;
};

/// Along one axis of the lattice.
struct AxisChange {
  double factor = 1;  // the length's
  double shift = 0;   // along the axis, in the splat's length before
  double growth = 0;  // afterwards
};

/// Collects changes along up to three axes, and makes them. Throws nothing.
class Reshape {
 public:
  /// `axis`: unit length, in the splat's frame; what it has of the axes before is taken out. Returns false, and adds nothing, if
  /// too little is left.
  bool add(const glm::dvec3& axis, const AxisChange& change);
  /// Changes the splat, its codes and lines, and the scalars, whose gradients stay. Its growth is kept along axes that were not added.
  void apply(NodeSplat& node, std::span<SplatScalar> values) const;

 private:
  std::array<glm::dvec3, 3> axes_{};
  std::array<AxisChange, 3> changes_{};
  size_t count_ = 0;
};

/// The code of a growth whose axes become in_frame(axis), of unit length, in another frame.
template <typename InFrame>
uint32_t growthAlong(const CellGrowth& growth, const InFrame& in_frame) {
  GrownAxes axes;
  for (size_t n = 0; n < 3; ++n)
    if (growth.growth[n] != 0)
      axes.add(in_frame(glm::dvec3(growth.axis[n])), static_cast<double>(growth.growth[n]));
  return axes.code();
}

}  // namespace curvisplat
