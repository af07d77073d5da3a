// Cuts the splats of nodes that are one away from faces of their block: they reach beyond these faces by a hundredth of a cell's
// weight.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <optional>

#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/node_lattice.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"

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

/// Where the cell of a node ends that is behind one face.
struct CutBehindFace {
  uint32_t border_code = kNoBorder;
  glm::dvec3 face_node{0.0};  // the face's, next to the node
  double spacing = 0;         // NodeSplat's, of that one
};

/// The same behind several faces, or where the cell ends at others.
struct CutBehindFaces {
  LayeredBorder border;
  std::array<FaceProbe, 3> probes{};
  size_t count = 0;  // of the probes; 0: the cell is not cut
};

/// Pure: any thread.
class FacesBehind {
 public:
  /// `middles`: as in NodeSplatCorrections, the face goes through the middles of its cells. The lattice outlives it.
  FacesBehind(const NodeLattice& lattice, bool middles) : lattice_(lattice), middles_(middles) {}

  /// Of a node's splat that is behind a face of one axis, whose neighbours along it are both there; none if the face has collapsed.
  std::optional<CutBehindFace> cutAtOne(const NodeBehind& behind, int axis, const Splat& splat) const;

  /// Of a node's splat that ends at faces (`inwards`, as borderCode() takes it) or is behind several. `along`: columns, the
  /// frame's images of the directions inwards from these faces along i, j, k.
  CutBehindFaces cutAtSeveral(const NodeBehind& behind, const std::array<double, 3>& inwards,
                              const glm::dmat3& along, const Splat& splat) const;

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
