// The gradient of a scalar at a grid's nodes (grid_nodes.h), and which nodes are at one place. Isosurfaces are lit by it: the normal of a
// vertex is the gradient's direction, and where blocks meet, or one closes on itself, it is the same on either side.
//
// Along each axis of the block a parabola goes through three nodes, at a border those next to it. At a place of several nodes the gradients
// of all of them count, the more the wider the angles between their axes: from either side of a seam they are one-sided, and their mean is
// not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "render/surface/grid_nodes.h"

namespace curvisplat {

class NodeGradients {
 public:
  /// Takes 4 bytes a node, and 8 a node that shares a splat, of a grid that has such nodes. `nodes` must outlive it.
  explicit NodeGradients(const GridNodes& nodes);

  /// The one of the nodes at a place that stands for all.
  size_t representative(size_t node) const { return same_.empty() ? node : same_[node]; }
  /// Whether other nodes are at the place of this one.
  bool isShared(size_t node) const;
  /// The gradient at a node, in the data's coordinates; 0 where the cells are collapsed.
  glm::dvec3 at(size_t node) const;

 private:
  /// The gradient times its weight, the volume between unit vectors along the axes.
  struct Weighted {
    glm::dvec3 gradient{0.0};
    double weight = 0;
  };
  Weighted ofOne(size_t node) const;

  const GridNodes& nodes_;
  std::vector<uint32_t> same_;       // [node]: the node that has its splat; empty if each has its own
  std::vector<JoinedNode> by_same_;  // in the order of the nodes that have splats
};

}  // namespace curvisplat
