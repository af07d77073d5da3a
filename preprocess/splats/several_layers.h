// How cells in the layers behind faces fit where the renderer cuts them.
//
// The code of a cell behind several faces, or behind one and at another, has no distances: it is cut about one length from its middle
// (stream/model/layers_code.h). Where cells shrink suddenly towards the face, it is nearer: at 0.83 where the last cell is half as
// long as the one before. What lies beyond, a hundredth of the cell's weight, is seen as a fringe. x is the logarithm of what the
// cell is too long by. Cells become shorter and move inwards, by half as much as it takes, and the half cells at the face follow, so
// that a uniform medium is as even as before:
//
//                      ln s       growth inwards    drift inwards
//     one behind     -0.34 x          1.25 x          0.13 x
//     at the face    -0.4 x              x
//
// By least squares in one dimension, over lines whose last cell is shorter, of the density and of the length beyond the face, which
// counts 0.13; then 1.3 times as much, for less than 0.1 % outside of multi_bin. Outside, rms and p98/p2 of multi_bin:
//
//     nothing      0.32 %    2.64 %    1.126
//     1 times      0.13      2.74      1.131
//     1.3 times    0.09      2.79      1.134
//     1.5 times    0.05      2.86      1.136
//
// Cells that fit exactly leave 0.01 %, but make a band along the edges of the block, rms 4.4 %.
//
// Where the face turns out to be a joint of blocks, all of it is undone (joint_sides.cpp): so x is found from the row that is known
// there, too (joint_line.h). Elements of three steps have x = 0.075, and fit well enough as they are.
#pragma once

#include <array>
#include <glm/vec3.hpp>

#include "preprocess/splats/faces_behind.h"
#include "preprocess/splats/joint_line.h"

namespace curvisplat {

struct LayerFit {
  double factor = 1;             // of the length
  double growth = 0, drift = 0;  // inwards
};

/// Of a cell one away from the face, by its line across it.
LayerFit fitBehindFace(const JointLine& line);
/// Of a half cell at the face.
LayerFit fitAtFace(const JointLine& line);

/// What a node's cell ends at and is behind along i, j and k, as computeNodeSplats() has it.
struct CellAtFaces {
  const std::array<double, 3>& inwards;  // borderCode()'s
  const Layers& layers;
  const std::array<JointLine, 3>& lines;
};
/// Where its middle is from the node, how much longer its splat is, and how it grows.
struct CellOnLattice {
  glm::dvec3 &middle, &stretch;
  std::array<float, 3>& growth;
};

/// Makes a cell that ends at several faces, or is behind some, fit where it is cut. False if it is another cell.
bool fitToLayers(const CellAtFaces& at, const CellOnLattice& cell);

}  // namespace curvisplat
