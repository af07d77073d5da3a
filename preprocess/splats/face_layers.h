// The faces that a cell lies in the layers behind of, where its border code has several directions: those of nodes on one face of a
// block and one node away from another, and of nodes one away from two or three faces (stream/model/border_code.h).
//
// Whether such a face is a seam is known at the node of the face next to the cell, not at the cell's own. So a probe is sent there,
// one for each face, and the cell waits for the answers (seams.h).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "stream/model/border_code.h"

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

/// A code with layers. Two bits for each of its axes: 0, or 1 and the axis of the lattice along which the cell lies
/// behind a face.
struct LayeredBorder {
  uint32_t code = kNoBorder;
  uint8_t layers = 0;
};

/// Of a cell that ends at the borders `ends`, all of them faces, and lies behind those of `layers`: at right angles, three
/// directions in all at the most.
LayeredBorder layeredBorder(std::span<const glm::dvec3> ends, std::span<const LayerAxis> layers);

/// The axis of the lattice of the code's axis n; -1 if that is no layer's.
inline int latticeAxis(uint8_t layers, int n) {
  return (layers >> 2 * n & 3) - 1;
}

/// What is left of `border` if the faces across some axes of the lattice are seams: bit n, axis n.
LayeredBorder withoutSeams(const LayeredBorder& border, uint32_t axes);

}  // namespace curvisplat
