// The faces of its block that a cell lies one node behind, and what they make of its splat. First its
// border code, where that has several directions: of nodes on one face and one away from another, and of
// nodes one away from two or three faces (stream/model/border_code.h). Then where the splat is cut
// (FacesBehind), and how it is made to fit there (fitToLayers()).
//
// Whether such a face is a seam is known at the node of the face next to the cell, not at the cell's own.
// So a probe is sent there, one for each face, and the cell waits for the answers
// (preprocess/seams/seams.h). Pure: any thread.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "preprocess/splats/block_window.h"
#include "preprocess/splats/stretch.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Asks whether a face is a seam.
struct FaceProbe {
  uint8_t axis = 0;  // of the lattice, across the face
  glm::dvec3 face_node{0.0};
  double spacing = 0;  // NodeSplat's, of the node on the face
};

/// A direction that leads from such a face.
struct LayerAxis {
  glm::dvec3 inward{0.0};  // unit length, in the frame of the cell's splat
  uint8_t axis = 0;        // of the lattice
  double distance = 1;     // of the face from the cell's middle, in cells
};

/// A code with layers. Two bits for each of its axes: 0, or 1 and the axis of the lattice along which the
/// cell lies behind a face.
struct LayeredBorder {
  uint32_t code = kNoBorder;
  uint8_t layers = 0;
};

/// The code of a cell that ends at the borders `ends`, all of them faces, and lies behind those of `layers`:
/// at right angles, three directions in all at the most.
LayeredBorder layeredBorder(std::span<const glm::dvec3> ends, std::span<const LayerAxis> layers);

/// The axis of the lattice of the code's axis n; -1 if that is no layer's.
inline int latticeAxis(uint8_t layers, int n) {
  return (layers >> 2 * n & 3) - 1;
}

/// The rest of `border` if the faces across some axes of the lattice are seams: bit n, axis n.
LayeredBorder withoutSeams(const LayeredBorder& border, uint32_t axes);

/// The faces of a block that a node is one away from: along i, j and k 1 from the lower one, -1 from the
/// upper one, or 0.
using Layers = std::array<int, 3>;

/// The layer of a node with this index along an axis of `count` nodes; 0 in blocks of three nodes or fewer.
inline int layerOf(uint64_t index, uint64_t count) {
  if (count < 4) return 0;
  return index == 1 ? 1 : index + 2 == count ? -1 : 0;
}

struct NodeBehind {
  ptrdiff_t at = 0;  // element of NodeArrays
  Neighbours neighbours;
  Layers layers{};
};

/// The end of a node's cell that is behind one face.
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

/// Cuts the splats of nodes that are one away from faces of their block: they reach beyond these faces by a
/// hundredth of a cell's weight.
class FacesBehind {
 public:
  /// `middles`: as in SplatCorrections, the face goes through the middles of its cells. The lattice
  /// outlives it.
  FacesBehind(const NodeLattice& lattice, bool middles) : lattice_(lattice), middles_(middles) {}

  /// Cuts the splat of a node that is behind a face of one axis, and whose neighbours along it are both
  /// there; nullopt if the face has collapsed.
  std::optional<CutBehindFace> cutAtOne(const NodeBehind& behind, int axis, const Splat& splat) const;

  /// Cuts the splat of a node that ends at faces (`inwards`, as borderCode() takes it) or is behind several.
  /// `along`: columns, the frame's images of the directions inwards from these faces along i, j, k.
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

/// How a cell in the layers behind faces is made to fit where the renderer cuts it.
///
/// The code of a cell behind several faces, or behind one and at another, has no distances: it is cut about
/// one length from its middle (stream/model/border_code.h). Where cells shrink suddenly towards the face,
/// the face is nearer: at 0.83 where the last cell is half as long as the one before. The part beyond it, a
/// hundredth of the cell's weight, is seen as a fringe. With x, the logarithm of the factor by which the
/// cell is too long, cells become shorter and move inwards, by half of what would fit, and the half cells
/// at the face follow, so that a uniform medium is as even as before (kShortBehindFace and kShortAtFace,
/// stream/model/fits.h).
///
/// Where the face turns out to be a joint of blocks, all of it is undone
/// (preprocess/seams/joint_sides.cpp), so x is found from the row that is known there, too (JointLine,
/// stretch.h). Elements of three steps have x = 0.075, and fit well enough as they are.
struct LayerFit {
  double factor = 1;             // of the length
  double growth = 0, drift = 0;  // inwards
};

/// The fit of a cell one away from the face, by its line across it.
LayerFit fitBehindFace(const JointLine& line);
/// The fit of a half cell at the face.
LayerFit fitAtFace(const JointLine& line);

/// The faces that a node's cell ends at and is behind along i, j and k, as computeNodeSplats() has it.
struct CellAtFaces {
  const std::array<double, 3>& inwards;  // borderCode()'s
  const Layers& layers;
  const std::array<JointLine, 3>& lines;
};
/// The middle of the cell from the node, how much longer its splat is, and how it grows.
struct CellOnLattice {
  glm::dvec3 &middle, &stretch;
  std::array<float, 3>& growth;
};

/// Makes a cell that ends at several faces, or is behind some, fit where it is cut. False if it is another
/// cell.
bool fitToLayers(const CellAtFaces& at, const CellOnLattice& cell);

}  // namespace curvisplat
