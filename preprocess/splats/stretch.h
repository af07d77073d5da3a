// How much longer than its cell a splat is along each lattice axis, how it is skewed there, and how far it
// is from the cell's middle, so that a uniform medium looks uniform where the sizes of neighbouring cells
// differ. JointLine (below) is the line of cells that leads to a face of a block, which may go on in
// another block. Pure functions: any thread.
//
// Boxes tile space, and boxes that are convolved with one common blur still sum to one everywhere. A kernel
// is a box, of 41.8 % of its variance, and a blur, which must vary slowly from cell to cell: so a splat is
// wider than a cell that is small for its neighbours, and skewed where cells grow
// (stream/model/growth_code.h). With the logarithms l of five extents along the axis's grid line, less that
// of the splat's own cell,
//
//     curve = l(-1) + l(1)   far_curve = l(-2) + l(2)   slope = l(1) - l(-1)   bend = l(2) - l(-2) - 2 slope
//
// and q = u max(0, slope² - 0.7) for cells that grow steeply and steadily: u, from 0 to 1, is by what ln h
// goes on to fall beyond the smaller neighbour over by what it falls to it (0 in spectral elements, where it
// rises again). s is the splat's length over the cell's, the drift is towards the larger cells, in cells:
//
//     ln s  = a1 curve + a2 curve² + a3 bend slope + q (b1 + b2 curve² + b3 bend)
//     g     = slope (1/2 + c1 curve + c2 far_curve) + bend (c3 + c4 curve) + c5 q
//     drift = slope (kDrift / 2 + d1 curve) + d2 bend + d3 q
//
// with bend and q in the terms of b3, c5 and d3 taken towards the larger cells. stream/model/fits.h has the
// numbers. Where cells grow by a constant factor e^g only `slope` is not zero: s is 1, and the drift 0.14 g.
// That makes up for blurs that widen with the cells, which carry more from each into the smaller ones than
// they get back: a medium would be 1 + 0.14 g² too dense.
//
// A line ends at a block's face and beside a missing cell. There the extents are mirrored, less their steady
// growth: the smaller of the two growths next to the end, 1 where they disagree or the line is short.
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "stream/model/fits.h"

namespace curvisplat {

/// How far along a line the samples reach that determine s, on either side.
inline constexpr int kStretchReach = 4;

/// Whether the fit has the terms for steep growth. Caches without kSteepStretch (stream/cache/manifest.h)
/// were made without them, and so are cells of cell-centred data.
enum class StretchFit : uint8_t { kGentle, kSteep };

/// The corrections of a splat that follow from the extents along an axis.
struct Stretch {
  float factor = 1;  // s: between 0.74 and 1.57
  float growth = 0;  // g
  float drift = 0;
};

/// The largest growth of any splat.
inline constexpr float kLargestGrowth = 0.65f;

/// The logarithm of the root of a positive number, ln √x, to 1e-6. Single precision: it is quicker, and bits
/// do not depend on vector instructions.
[[gnu::always_inline]] inline float halfLogarithm(float x) {
  constexpr uint32_t kRootOfHalf = 0x3f3504f3;
  const auto bits = std::bit_cast<uint32_t>(x);
  const int32_t power = static_cast<int32_t>(bits - kRootOfHalf) >> 23;
  const float part = std::bit_cast<float>(bits - (static_cast<uint32_t>(power) << 23));
  const float t = (part - 1) / (part + 1), t2 = t * t;
  return 0.34657359f * static_cast<float>(power) + t * (1 + t2 * (1.0f / 3 + t2 * (1.0f / 5)));
}

/// The stretch from the squared extents of five cells in a row, the third of which is the splat's own. s is 1
/// where it is nearly 1 (a stored shape cannot be told from it); all is as in an even grid where a cell has
/// no extent.
[[gnu::always_inline]] inline Stretch stretchOf(double before2, double before, double own, double after,
                                                double after2, StretchFit fit = StretchFit::kSteep) {
  constexpr float kNearlyOne = 2e-4f;
  constexpr double kLargest = 1e6;  // of squared ratios
  constexpr float kMinGrowth = 1e-3f;
  const double per_own = 1 / own;
  const auto is_usable = [](double x) { return x > 0 && x < 1e300; };
  const bool usable = is_usable(before2) & is_usable(before) & is_usable(own) & is_usable(after) &
                      is_usable(after2) & is_usable(per_own);
  const auto logarithm = [&](double extent) {
    const double ratio = usable ? extent * per_own : 1.0;
    return halfLogarithm(static_cast<float>(std::clamp(ratio, 1 / kLargest, kLargest)));
  };
  const float l0 = logarithm(before2), l1 = logarithm(before), l2 = logarithm(after), l3 = logarithm(after2);
  const float slope = l2 - l1;
  const float curve = std::clamp(l1 + l2, -1.25f, 1.25f), far_curve = std::clamp(l0 + l3, -2.0f, 2.0f);
  const float bend = std::clamp((l3 - l0) - 2 * slope, -1.5f, 1.5f);
  const float smaller = slope > 0 ? l1 : l2, smallest = slope > 0 ? l0 : l3;
  const float steadiness =
      smaller < -kMinGrowth ? std::clamp((smallest - smaller) / smaller, 0.0f, 1.0f) : 0.0f;
  const float over = std::max(std::min(slope * slope, 4.0f) - kSteepFrom, 0.0f);
  const float steep = fit == StretchFit::kSteep ? over * steadiness : 0.0f;
  const float x =
      std::clamp(curve * (kLengthByCurve + kLengthByCurve2 * curve) + kLengthByBendSlope * (bend * slope) +
                     steep * (kSteepLength + kSteepLengthByCurve2 * (curve * curve) +
                              kSteepLengthByBend * std::copysign(1.0f, slope) * bend),
                 -0.3f, 0.45f);
  const float s = 1 + x * (1 + x * (1.0f / 2 + x * (1.0f / 6 + x * (1.0f / 24))));
  const float along = std::copysign(steep, slope);
  return {
      std::abs(x) < kNearlyOne ? 1.0f : s,
      std::clamp(slope * (0.5f + kGrowthByCurve * curve + kGrowthByFarCurve * far_curve) +
                     bend * (kGrowthByBend + kGrowthByBendCurve * curve) + kSteepGrowth * along,
                 -kLargestGrowth, kLargestGrowth),
      std::clamp(slope * (0.5f * kDrift + kDriftByCurve * curve) + kDriftByBend * bend + kSteepDrift * along,
                 -0.125f, 0.125f)};
}

/// The steady growth per sample of squared extents, from those of the three samples next to the end of a
/// line, the nearest first.
inline double steadyGrowth(double first, double second, double third) {
  const double near = second / first, far = third / second;
  if (near > 1 && far > 1) return std::min(near, far);
  if (near < 1 && far < 1) return std::max(near, far);
  return 1;  // also where a cell has no extent
}

/// Positions of a window's nodes.
struct NodePositions {
  const double *x, *y, *z;

  /// |X₁ - X₀|² of two elements.
  double squaredDistance(ptrdiff_t from, ptrdiff_t to) const {
    const double dx = x[to] - x[from], dy = y[to] - y[from], dz = z[to] - z[from];
    return dx * dx + dy * dy + dz * dz;
  }
};

/// The square of how long `way` is along `normal`, which may have any length; of the whole of `way` if it has none.
inline double squaredAcross(const glm::dvec3& way, const glm::dvec3& normal) {
  const double area = glm::dot(normal, normal), volume = glm::dot(way, normal);
  return area > 0 ? volume * volume / area : glm::dot(way, way);
}

/// How long the cells around a node are along a grid line: as far as they reach across the faces of the node's own cell. It is the
/// length along the line where lines cross at right angles. Where layers are sheared, as over mountains, the line lengthens from
/// cell to cell, and the cells do not.
struct CellLengths {
  NodePositions nodes;
  /// The normal of those faces, as long as they are large. Zero: lengths along the line, as in caches without kCellWidths
  /// (stream/cache/manifest.h).
  glm::dvec3 normal{0.0};

  /// The square of how far two nodes of the line are apart.
  double squared(ptrdiff_t from, ptrdiff_t to) const {
    const glm::dvec3 way(nodes.x[to] - nodes.x[from], nodes.y[to] - nodes.y[from],
                         nodes.z[to] - nodes.z[from]);
    return squaredAcross(way, normal);
  }
};

/// Nodes that follow one another in memory, each with three neighbours on either side along an axis, and one along the others.
struct NodeRow {
  NodePositions nodes;
  ptrdiff_t at;      // element of the first one
  ptrdiff_t stride;  // of the axis
  size_t count;
  std::array<ptrdiff_t, 2> across{};  // strides of the two other axes; 0: lengths along the lines
};

/// Stretch of the nodes of a row.
struct StretchRow {
  float *factor, *growth, *drift;
};

/// Finds the stretches of a row of nodes. The same bits as stretchOf(extentsOnLine()) would give. Any thread; never allocates.
void stretchNodes(const NodeRow& row, const StretchRow& out, StretchFit fit = StretchFit::kSteep);

/// Twice the extents, squared, of five cells in a row.
using SquaredExtents = std::array<double, 5>;

/// The squared extents around the node `at`, which has `before` neighbours in a row on one side and `after`
/// on the other; more than kStretchReach count as kStretchReach. All zero if it has none.
SquaredExtents extentsOnLine(const CellLengths& cells, ptrdiff_t at, ptrdiff_t stride, int before, int after);

inline Stretch stretchOf(const SquaredExtents& e, StretchFit fit = StretchFit::kSteep) {
  return stretchOf(e[0], e[1], e[2], e[3], e[4], fit);
}

/// The lengths of five cells in a row, in world units, from the other side of the joint on. The third is the
/// splat's own: of a node on the face, as long as its block makes it.
using CellRow = std::array<double, 5>;

/// The stretch of the middle one of five cells; its growth and its drift are towards the row's end.
inline Stretch stretchOfRow(const CellRow& row, StretchFit fit) {
  return stretchOf(row[0] * row[0], row[1] * row[1], row[2] * row[2], row[3] * row[3], row[4] * row[4], fit);
}

/// The stretch of a half cell that ends at a border. Half cells at borders are cut (border_code.h), and the
/// cut is fitted to even cells: if they were not stretched by a share of what a whole cell would be, a gap
/// would show behind the border.
inline double stretchAtBorder(double of_whole) {
  return 1 + kStretchAtBorder * (of_whole - 1);
}

/// How cells follow one another across a joint of blocks: the row of a node on a face of its block, or one
/// away from it, across the face. Some of its five cells belong to the other block. A block alone does not
/// know them: it takes its own for them, mirrored. Once the face's nodes are found to be another block's as
/// well (preprocess/seams/joint_nodes.h), the cells are as if the grid had never been cut.
///
///      block A            |           block B
///      o     o     o     o|o   o   o   o        the five cells of A's node on the face (2),
///            1     2     2 2   2   2            and of the one beside it (1)
///      1     1     1     1 1   1
///
/// Lengths are kept to 1.5 %, up to 39 times the unit.
class JointLine {
 public:
  JointLine() = default;
  /// `unit`: > 0, the length of the node's half cell, or of its whole cell one away from the face.
  JointLine(const CellRow& row, double unit);
  /// The same from the squares of twice the lengths.
  static JointLine ofExtents(const SquaredExtents& extents, double unit);

  bool isThere() const { return unit_ > 0; }
  double unit() const { return unit_; }
  CellRow row() const;
  Stretch stretch(StretchFit fit) const { return stretchOfRow(row(), fit); }

  /// The direction of the row, away from the face, in the frame of the node's splat: to a hundredth.
  glm::dvec3 inward() const;
  /// The same to 1e-7: thin layers that are bent are many times as wide as they are thick.
  glm::dvec3 exactInward() const;
  void setInward(const glm::dvec3& unit_vector);

 private:
  static constexpr double kStep = 1.0 / 24;  // of binary logarithms: even cells come out even

  float unit_ = 0;
  std::array<int8_t, 5> logarithms_{};
  std::array<int8_t, 3> inward_{};
  std::array<float, 3> exact_inward_{};
};

}  // namespace curvisplat
