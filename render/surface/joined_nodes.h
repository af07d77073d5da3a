// Finds the nodes that share a splat: faces of blocks that meet, or one that is folded, closed or collapsed onto a line. The splat is
// stored as one of the nodes; the others have none, and are found by where the grid lines that lead to their face would go on to.
//
// Node by node the nearest one may be the wrong one, where cells are much thinner than they are long. So maps are tried of how the
// lattice of a face lies on that of another (or on its own): whole, or, as its nodes vote, turned, mirrored, shifted or collapsed. The
// one counts that finds the most nodes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

namespace curvisplat {

/// The lattice of a block's nodes.
struct NodeLattice3 {
  std::array<uint64_t, 3> size;  // along i, j, k
  size_t first;                  // number of its first node; i fastest

  size_t stride(size_t axis) const {
    return static_cast<size_t>(axis == 0 ? 1 : axis == 1 ? size[0] : size[0] * size[1]);
  }
  size_t nodes() const { return static_cast<size_t>(size[0] * size[1] * size[2]); }
};

/// A node without a splat, and the one that has it.
struct JoinedNode {
  uint32_t node, same;
};

/// The bytes that finding them takes for a block.
uint64_t joinBytes(const NodeLattice3& block);

/// The partners of nodes for which is_there[node] is 0, in the order of the nodes: of `count` of them, the others are blanked. None if it
/// cannot be told which these are. `at`: where a node is.
/// Takes as long as some 10⁸ comparisons at most. `throw_if_stopped` is called for each face. Pure.
std::optional<std::vector<JoinedNode>> findJoinedNodes(std::span<const NodeLattice3> blocks,
                                                       std::span<const uint8_t> is_there, uint64_t count,
                                                       const std::function<glm::dvec3(size_t node)>& at,
                                                       const std::function<void()>& throw_if_stopped);

}  // namespace curvisplat
