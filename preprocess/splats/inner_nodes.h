// Numbers and growth codes of the splats of nodes that have all six neighbours and lie behind no face:
// nearly all nodes of a grid. They are computed several at once, by vector instructions, and have the same
// bits as one after the other (node_splats.cpp, which has the formulas' reasons), whatever the instruction
// set: nothing is fused, and sums have the same order. Pure: any thread. Never allocates.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "preprocess/splats/stretch.h"
#include "stream/model/splats.h"

namespace curvisplat {

inline constexpr size_t kInnerNodesAtOnce = 8;

/// The most that a grid may bend at a node, in its own cells, for its scalars to be carried to the middle of
/// the cell by their slopes. Where thin layers bend by more than they are thick (layers of 1 km on a sphere
/// of 5 degrees: 48 cells), the middle lies below layers that have nothing to do with the node.
inline constexpr double kMaxBend = 4;

/// How much of a cell's volume the corrections of dual_cell.h are at the most.
inline constexpr double kMaxCorrection = 1.0 / 512;

/// Nodes that follow one another in a row.
struct InnerRow {
  NodePositions positions{};                       // of the window's nodes
  ptrdiff_t at = 0;                                // the first node's element
  std::array<ptrdiff_t, 3> strides{};              // to the next element along i, j and k
  std::array<const float*, 3> stretch{}, drift{};  // [axis][node]
  std::span<const float* const> scalars;           // [scalar][element]
  double bend = 0;  // what a mean is corrected by, for a second difference of 1
};

/// Element n of each array is of the n-th node.
struct alignas(64) InnerSplats {
  using Row = double[kInnerNodesAtOnce];

  Row position[3], axis[3], shear[3], weight, determinant;
  Row rotated[3][3];  // [axis of the lattice][component]: Q's image of its unit vector
  Row lower[6];       // a00 a10 a11 a20 a21 a22
  // No axis is floored, and the dual cell's corrections are small; else
  bool is_plain[kInnerNodesAtOnce];  // the node's numbers are of no use
};

/// Computes the splats of nodes `first` to first + kInnerNodesAtOnce - 1 of the row, with all corrections
/// (SplatCorrections). `values`: [node of these * scalars + scalar].
void computeInnerNodes(const InnerRow& row, size_t first, InnerSplats& out, SplatScalar* values);

/// Stands for a code (stream/model/growth_code.h) where the cell grows along several axes.
inline constexpr int32_t kGrowsAlongSeveral = -1;

struct alignas(64) InnerGrowthCodes {
  int32_t of[kInnerNodesAtOnce];  // as growthCode(), the same bits; or kGrowsAlongSeveral
};

/// The growth codes of the nodes of `splats`. Most cells grow along one axis of the lattice, or along none;
/// the codes of the others are left to growthCode(). `growth`: [axis][node].
void findInnerGrowth(const InnerSplats& splats, const std::array<const float*, 3>& growth,
                     InnerGrowthCodes& out);

}  // namespace curvisplat
