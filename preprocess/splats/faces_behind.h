// Cuts the splats of nodes that are one away from faces of their block: they reach beyond these faces by a hundredth of a cell's
// weight.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/mat3x3.hpp>

#include "preprocess/splats/node_lattice.h"
#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// The faces of a block that a node is one away from: along i, j and k 1 from the lower one, -1 from the upper one, or 0.
using Layers = std::array<int, 3>;

/// Of a node with this index along an axis of `count` nodes; 0 in blocks of three nodes or fewer.
inline int layerOf(uint64_t index, uint64_t count) {
  if (count < 4) return 0;
  return index == 1 ? 1 : index + 2 == count ? -1 : 0;
}

struct NodeBehind {
  ptrdiff_t at = 0;  // element of NodeArrays
  Neighbours neighbours;
  Layers layers{};
};

/// Pure: any thread.
class FacesBehind {
 public:
  /// `middles`: as in NodeSplatCorrections, the face goes through the middles of its cells.
  FacesBehind(const NodeLattice& lattice, bool middles) : lattice_(lattice), middles_(middles) {}

  /// Sets the border code of a node that is behind a face of one axis, whose neighbours along it are both there.
  void cutAtOne(const NodeBehind& behind, int axis, NodeSplat& node) const;

  /// Sets the border code of splat `number`, which ends at faces (`inwards`, as borderCode() takes it) or is behind several, and
  /// adds the probes for it. `along`: columns, the frame's images of the directions inwards from these faces along i, j, k.
  void cutAtSeveral(const NodeBehind& behind, const std::array<double, 3>& inwards, const glm::dmat3& along,
                    size_t number, NodeSplats& out) const;

 private:
  /// A face of the block, at the node of it next to the node behind.
  struct Face {
    ptrdiff_t node;            // element of NodeArrays
    Neighbours beside;         // its own
    glm::dvec3 position{0.0};  // of the plane, with the
    glm::dvec3 normal{0.0};    // inwards; zero where the face has collapsed
  };
  Face faceOf(const NodeBehind& behind, int axis) const;

  const NodeLattice& lattice_;
  const bool middles_;
};

}  // namespace curvisplat
