// Where the cells of coincident parts go on across a joint, and what that makes of them (joint_line.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/splats/joint_line.h"
#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// One direction of a part's border code, across which another part has its other half.
struct JointSide {
  size_t part = 0;
  int direction = 0;
  glm::dvec3 inward{0.0};  // in the part's frame
  CellRow row{};           // around the whole cell, towards the part's side
};

/// The sides of parts of one group, by part and direction. `group`: [part]. Those without lines have none.
std::vector<JointSide> sidesOf(std::span<const NodeSplat* const> parts, std::span<const size_t> group);

/// By how much a half was made longer along a direction to fit where it is cut (several_layers.h).
double fittedFactor(const NodeSplat& half, const glm::dvec3& inward);

/// Makes the halves of `half`, which has `sides`, those of an unstretched cell: their borders stay. Only `splat` and `values` change.
void unstretchHalves(const NodeSplat& half, std::span<const JointSide> sides, Splat& splat,
                     std::span<SplatScalar> values);

/// Makes `merged` as long as a whole cell is in the rows of `sides`, which are of `part`, one of those that it was merged of.
void stretchWhole(const NodeSplat& part, std::span<const JointSide> sides, NodeSplat& merged,
                  std::span<SplatScalar> values);

/// What `line`, of a node one away from the face, is if one of the sides leads to the node.
std::optional<JointLine> lineBehind(std::span<const NodeSplat* const> parts, std::span<const JointSide> sides,
                                    const NodeSplat& behind, const JointLine& line);

/// Makes the splat of such a node what it is with `joined` in place of its own line along that axis of the lattice.
void goOnAcross(size_t axis, const JointLine& joined, NodeSplat& behind, std::span<SplatScalar> values);

}  // namespace curvisplat
