// The piece of the grid around a node, whose volume is the weight of its splat: the dual cell. Each trilinear cell around the
// node that is there gives it the octant next to the node. Dual cells tile the grid, also at its ends and beside blanked nodes:
//
//     o-----------o-----------o     o   node
//     |     +-----|-----+     |     +   middle of a cell; the sides of the piece go through the middles of edges
//     |     |     |     |     |         and faces
//     o-----|-----o-----|-----o
//     |     +-----|-----+     |
//     o-----------o-----------o
//
// With central differences x_i, x_ii, x_ij, x_ijj (x_i half of the difference of the neighbours along i), the volume of a
// whole dual cell is
//
//     |x_i x_j x_k|  +  1/8 sum over p of |(x_pqq + x_prr) x_q x_r|                          p, q, r: i, j, k in turn
//                    +  1/8 sum over p of |x_p (x_qr  x_rr + x_qq  x_qr + 1/2 x_qp  x_rp)|   products in the brackets: crossed
//
// and terms of higher order, about the square of these corrections. Without twists the first term is exact. Where the
// corrections are above kMaxCorrection, the octants are measured one by one; volumes are exact to 1e-4 then.
//
// Rejected: the hexahedron of the middles of the eight cells around the node, which tiles space as well and is as quick.
// Its sides are straight, so that at a curved border one piece loses the whole sagitta.
// Pure: any thread.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "preprocess/splats/block_window.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Cells around a node are numbered: bit `axis` is set if the cell is above the node along that axis.
inline constexpr uint32_t kCellsAround = 8;
inline constexpr uint32_t kAllCellsAround = (1u << kCellsAround) - 1;

/// Bit n: cell n around node `at` is there: it is in the block, and none of its nodes is blank. `index`, `count`: the
/// node's along i, j, k, and the block's nodes.
uint32_t cellsAround(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides,
                     const std::array<uint64_t, 3>& index, const std::array<uint64_t, 3>& count);

/// The part of a dual cell that is there.
struct DualPiece {
  double volume = 0;               // signed
  glm::dvec3 first{0.0};           // the integral of x - X, X the node's position
  std::array<double, 6> second{};  // those of the products xx xy yy xz yz zz of x - X
};

/// The octants of the cells `there` (cellsAround()) around node `at`. Moments only if `moments`.
DualPiece dualPiece(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides,
                    uint32_t there, bool moments);

/// The absolute volume of dualPiece().
double dualVolume(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides,
                  uint32_t there);

/// How much the other two columns of the Jacobian grow along each axis, from cell to cell: the diagonal of J^-1 dJ, without
/// the own column. 0 in grids whose lines are parallel, 1 one cell away from a pole. Blurs that widen with a cell's width
/// carry weight to the narrower ones as those that widen with its length do (kDrift): a splat moves by kWidthDrift of it.
/// Around a wall from which cells grow by 1.35, a uniform medium is 1.7 % too dense otherwise, and 5 % too thin at its end.
std::array<double, 3> widthGrowth(const NodeLattice& nodes, ptrdiff_t at, const Neighbours& neighbours);

/// Nodes closer than this fraction of the longest distance between neighbours are one: rounding alone sets those of a pole apart.
inline constexpr double kCollapsed = 1e-9;

/// A node whose cell has collapsed, at a pole or on a singular line.
struct CollapsedNode {
  const NodeLattice& nodes;
  ptrdiff_t at = 0;
  std::array<ptrdiff_t, 3> strides{};
  Neighbours neighbours;
  uint32_t there = 0;               // cellsAround()
  std::array<double, 3> inwards{};  // borderCode()'s
  double smallest = 0;              // shapeFromJacobian()'s
};
/// A splat with the moments of such a node's dual cell, and its border code; none where that has no volume. The wedges
/// around a pole are merged to one splat that fills the space around it. Sets `values` if there is one.
struct PieceSplat {
  Splat splat;
  uint32_t border_code = kNoBorder;
};
std::optional<PieceSplat> splatOfPiece(const CollapsedNode& node, std::span<const float* const> scalars,
                                       std::span<SplatScalar> values);

}  // namespace curvisplat
