// Nodes to splats: DESIGN.md, "Splats". Each node that is there gives one splat, the piece of space around it.
//
// A node's cell reaches half way to its neighbours, and the splat sits in the cell's middle. On an even grid
// that is the node; where spacing changes quickly (spectral elements: a factor of 1.6 from cell to cell)
// splats at the nodes themselves would draw stripes of +-30 %, and those in the middles draw a third of that.
// Where grid lines bend, the cell has a kink at the node, and its middle lies beside the node, on the inner
// side: by an eighth of the second difference. The faces that splats at borders are cut at move with it, to the
// middle of the kinked face.
//
// A splat says what the scalar is at its middle and how it changes from there: a tangent. Tangents of the
// neighbours do not meet where the scalar bends: their weighted mean lacks half the second derivative times
// the kernel's variance. This is added to the mean beforehand: a tenth (kBend) of each second difference,
// less the second difference that a linear scalar has where the coordinates bend. The mean stays within the
// range of the node and its neighbours.
//
// A splat is longer or shorter than the cell along each axis, by a factor near 1, so that uniform data looks
// uniform where cells of different sizes meet (stretch.h). Its weight stays the volume of the cell, its slope
// stays the scalar's gradient, and its middle stays where it is. A half cell is stretched by less (JointLine,
// stretch.h), and its border stays where it is, so that its middle moves.
//
// Where cells grow steadily along an axis the kernel is skewed (stream/model/growth_code.h).
//
// A missing neighbour (the block ends, or the node there is blank) makes the cell a half cell along that
// axis: the Jacobian's column is half of the one difference there is, and the splat sits a quarter cell
// inwards. Without any neighbour along an axis the column is zero. A node with its neighbours beside it, but
// without one across an edge or a corner of its cell, loses that octant of the cell: a cell of the grid is
// there only if all of its nodes are (covered_part.h). The border is a face that the splat is to
// be cut at (stream/model/border_code.h), but where the cell has collapsed: at poles, and on singular lines.
// The splats of the next layer of nodes reach beyond a face at the block's end by a hundredth of a cell's
// weight, and are cut there; not in blocks of three nodes or fewer along that axis.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/block_window.h"
#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/stretch.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "stream/model/kernel.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Half the variance of the kernel along an axis.
inline constexpr double kBend = 0.5 * kKernelSigma * kKernelSigma;

/// The code of where a cell ends, as in stream/model/border_code.h. `inwards`: along i, j, k, 1 or -1 from a
/// border; `faces`: whether the borders are faces to be cut at; `rotate` gives Q's image of a vector.
template <typename Rotate>
uint32_t borderCode(const std::array<double, 3>& inwards, bool faces, const Rotate& rotate) {
  std::array<glm::dvec3, 3> axes;
  size_t count = 0;
  for (int axis = 0; axis < 3; ++axis) {
    if (inwards[axis] == 0) continue;
    glm::dvec3 along(0.0);
    along[axis] = inwards[axis];
    axes[count++] = rotate(along);
  }
  return count > 0 ? packBorderCode({axes.data(), count}, faces ? (1u << count) - 1 : 0) : kNoBorder;
}

/// The growth code of a cell that grows by `growth` along i, j and k. `rotate` gives Q's image of a vector.
template <typename Rotate>
uint32_t growthCode(const std::array<float, 3>& growth, const Rotate& rotate) {
  constexpr float kMin = 1.0f / 64;  // less becomes none
  if (std::max({std::abs(growth[0]), std::abs(growth[1]), std::abs(growth[2])}) < kMin) return kNoGrowth;
  const glm::dmat3 axes(1.0);
  std::array<glm::dvec3, 3> rotated{};
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs(growth[axis]) < kMin)) rotated[axis] = rotate(axes[axis]);
  return packGrowthCode(rotated, {growth[0], growth[1], growth[2]});
}

/// A node's splat on its way into the cache.
struct NodeSplat {
  uint64_t node = 0;                 // number in the whole grid: block after block, i fastest, then j, k
  Splat splat;                       // position: world units, moved inwards where the node owns a half cell
  bool regular = true;               // every variable's variance is 0, and the weight is about a0 a1 a2
  uint32_t border_code = kNoBorder;  // stream/model/border_code.h
  uint32_t growth_code = kNoGrowth;  // stream/model/growth_code.h
  bool on_block_face = false;        // may coincide with a node of another face: to be merged by SeamMerger
  bool behind_face = false;          // its border_code is for a face that SeamMerger may find to be closed
  glm::dvec3 node_position{0.0};     // where the node itself is; behind a face, where the face's node is
  // The smallest distance > 0 from that node to a neighbour along an axis, 0 if there is none: the seams'
  // tolerance. Set only where SeamMerger is asked; 0 elsewhere.
  double spacing = 0;

  // [axis of the lattice]: the line of nodes along it, where it crosses a face of the block that the node is
  // on, or one away from.
  std::array<JointLine, 3> lines{};
  // The layers, as in LayeredBorder: those behind faces that SeamMerger may find to be closed, where the code
  // has several directions.
  uint8_t layers = 0;
  StretchFit fit = StretchFit::kSteep;  // what the stretch was found by
  bool fits_layers = false;             // it was made to fit where it is cut (face_layers.h)
  // No splat, but a FaceProbe of the node: node_position and spacing are of the face. See SeamMerger.
  bool is_probe = false;

  bool isForSeams() const { return on_block_face || behind_face || layers != 0; }
  /// The line that leads along a direction of the splat's frame; null if there is none.
  const JointLine* lineAlong(const glm::dvec3& inward) const;
  /// Makes the splat one of a part: keepUncovered() (covered_part.h) has left a part of the cell that has
  /// this code.
  void becomePart(uint32_t code) {
    border_code = code;
    growth_code = kNoGrowth;
    lines = {};
    regular = behind_face = false;
    layers = 0;
  }
};

/// The splats of some rows of one block. Values are [splat * variables + variable].
struct NodeSplats {
  std::vector<NodeSplat> splats;  // in node order
  std::vector<SplatScalar> values;
  struct Probe {
    size_t splat;  // its number
    FaceProbe probe;
  };
  std::vector<Probe> probes;  // of the splats that have layers, in their order
  uint64_t degenerate = 0;    // splats with a floored axis
  uint64_t right_handed = 0;  // those of the others with det J > 0
  uint64_t left_handed = 0;   // det J < 0. The smaller of a whole block's two sums counts its inverted cells
};

/// How splats are made: as conversions of today make them, or as an earlier version did, to whose caches scalars and time steps
/// are added.
struct SplatRules {
  bool steep = true;    // else stretches are StretchFit::kGentle (kSteepStretch)
  bool octants = true;  // else cells keep the octants that reach into blanked cells (kCellOctants)
  // Weights and scalars of dual cells (dual_cell.h); otherwise weights are |det J|, and the scalars of bent
  // layers follow their slopes however far (kMaxBend).
  bool dual_cells = true;
  bool widths = true;  // cells are as long as CellLengths says (stretch.h), else as their grid lines
  // Growth codes of all splats; otherwise only splats for seams have them: values do not depend on them, and
  // they take a sixth of the time.
  bool growth_codes = true;

  StretchFit fit() const { return steep ? StretchFit::kSteep : StretchFit::kGentle; }
};

/// Computes the splats of the nodes of `box` that are not blank. Overwrites `out` and keeps its capacity.
/// Pure: any thread. Throws nothing but bad_alloc.
void computeNodeSplats(const BlockWindow& in, const NodeBox& box, NodeScratch& scratch, NodeSplats& out,
                       const SplatRules& rules = {});

}  // namespace curvisplat
