// A cell cut into eight pieces, as merging takes it: across each column of A at its middle, so that the pieces
// are cells of half the size around A u, u = (±1/4, ±1/4, ±1/4). The pieces of one cell that go to the same
// voxel go as one group, whose moments follow from those of the cell without a look at each piece.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "preprocess/splats/shape.h"

namespace curvisplat {

inline constexpr int kPieces = 8;
/// Some pieces of a cell: bit n is that of piece n, whose u is positive along column c where bit c of n is
/// set.
using PieceSet = uint8_t;
inline constexpr PieceSet kAllPieces = 0xff;

/// Moments of a group, in the frame of the cell's A.
struct PieceGroup {
  double share = 0;      // of the cell's volume
  glm::dvec3 mean{0.0};  // of u
  Symmetric3 shape;  // 12 x the covariance of u, the pieces' own extents included: the unit matrix for all
};

/// `pieces` is not empty.
const PieceGroup& pieceGroup(PieceSet pieces);

/// Which voxels the pieces of a cell lie in.
struct PieceVoxels {
  std::array<glm::ivec3, kPieces> voxel;
  std::array<PieceSet, kPieces> pieces{};
  size_t count = 0;
};

/// Of a cell around `middle` with A's columns, in units of a cubic lattice of `edge` voxels an axis whose corner
/// is the origin. `middle` is in it. Pieces are not to leave the lattice: the cell is not cut across columns that
/// lead out of it, the farthest first. Any thread; never allocates.
PieceVoxels voxelsOfPieces(const glm::dvec3& middle, std::array<glm::dvec3, 3> columns, int edge);

}  // namespace curvisplat
