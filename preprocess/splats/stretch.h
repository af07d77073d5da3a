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
//     ln s  = 0.1531 curve + 0.0828 curve² - 0.0418 bend slope         s: the splat's length over the cell's
//     g     = slope (1/2 + 0.2892 curve - 0.0667 far_curve) + bend (0.0676 + 0.1392 curve)
//     drift = slope (0.07 + 0.0457 curve) + 0.0033 bend                towards the larger cells, in cells
//
// Where cells grow by a constant factor e^g only `slope` is not zero: s is 1, and the drift 0.14 g. That
// makes up for blurs that widen with the cells, which carry more from each into the smaller ones than they
// get back: a medium would be 1 + 0.14 g² too dense. The other numbers are by least squares over lines in
// one dimension: Gauss-Lobatto elements, growing elements, tanh spacing in blocks, jumps, random walks. Of
// six forms that were fitted the one was kept that served the real grids of bench/README.md best, nek above
// all. p98/p2 of the density in a uniform medium, with these, and with s² = 0.418 + 0.582 (ĥ/h)², ĥ the
// geometric mean with weights 1 4 6 4 1, g the slope of ln h over the same five, and 0.14 g:
//
//     elements of 4, 5, 6, 7, 9 steps       1.008 1.021 1.020 1.022 1.027     1.047 1.050 1.054 1.057 1.063
//     3, 5, 7 steps, elements growing 1.42  1.016 1.025 1.028                 1.035 1.056 1.062
//     tanh, blocks of 8, three strengths    1.044 1.058 1.070                 1.079 1.107 1.139
//     jumps by 1.5, by 2                    1.005 1.011                       1.010 1.025
//
// Cells that grow steadily by more than 1.52 are beyond that fit. With q = u max(0, slope² - 0.7) and u,
// from 0 to 1, by what ln h goes on to fall beyond the smaller neighbour over by what it falls to it (0 in
// spectral elements, where it rises again), and the signs of cells that grow along the axis:
//
//     ln s  += q (0.0948 - 0.1096 curve² + 0.0727 bend)      g -= 0.0654 q      drift += 0.0189 q
//
// By least squares over the lines above, lines that grow steadily up to 2.1, or to a shorter last cell, and
// those of the real grids. rms % and p98/p2, over the nodes' numbers, without these terms and with them:
//
//     growing by 1.6, 1.75, 1.9, 2.1              without  1.5 2.2 2.8 3.6 %, 1.043 1.064 1.087 1.114
//                                                    with  1.3 1.3 1.4 1.4 %, 1.036 1.037 1.042 1.043
//     by 1.9 to a cell half as long, and back     2.2 %, 1.098; with 1.1 %, 1.047
//     tanh, blocks of 8, growing by up to 3       1.8 %, 1.077; with 2.7 %, 1.101
//
// Wider splats blur the scalar, so that they are narrower than what would be most even (ln s of 0.32 at 1.9,
// with a drift of 0.21: 0.2 %). Rejected: u = 1 (a grid of Chebyshev elements: rms 1.16 to 1.71 %; tanh 8.7
// %); q = max(0, slope² - 0.7 - curve² - 1.2 bend²), with no other terms (tanh 4.2 %, multi_bin 2.81 instead
// of 2.74 %); the same terms for cells that grow by 1.19 or more (the dome: inside 39.1 to 39.7 dB, but
// p98/p2 1.045 to 1.054, scalar 36.0 to 35.7 dB); wider splats across an axis along which cells grow and
// become wider, by what the logarithm of their width grows, squared (the spokes in multi_bin's rings are
// gone, and the dome's ripples; but borders do not fit wider cells: the dome's scalar falls to 34.1 dB,
// delta_wing's rms rises from 3.31 to 3.48 %).
//
// A line ends at a block's face and beside a missing cell. There the extents are mirrored, less their steady
// growth: the smaller of the two growths next to the end, 1 where they disagree or the line is short.
//
// Rejected: smoothing the matrices S of the neighbours along all three axes, which is as good on spectral
// elements (ripple of 1.34 % and 1.22 %, for 1.36 % and 1.24 % this way), makes curved boundary layers
// thicker (the neighbours' long axes lean out of the layer) and harms cells that grow by 1.25 or more (1.1
// to 1.6 % on a dome of 1.25, 1.7 to 2.1 % at 1.5); the arithmetic mean of h², which has the latter fault
// too; four passes (no gain); weights that flow to smaller cells (no gain in such fits); a drift in
// proportion to g (gains half as much).
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace curvisplat {

/// How far along a line the samples reach that determine s, on either side.
inline constexpr int kStretchReach = 4;

/// How far a splat lies from its cell's middle where cells grow by e^g, in the cell's length and for g = 1.
inline constexpr double kDrift = 0.14;

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
  const float over = std::max(std::min(slope * slope, 4.0f) - 0.7f, 0.0f);
  const float steep = fit == StretchFit::kSteep ? over * steadiness : 0.0f;
  const float x = std::clamp(
      curve * (0.1531f + 0.0828f * curve) - 0.0418f * (bend * slope) +
          steep * (0.0948f - 0.1096f * (curve * curve) + 0.0727f * std::copysign(1.0f, slope) * bend),
      -0.3f, 0.45f);
  const float s = 1 + x * (1 + x * (1.0f / 2 + x * (1.0f / 6 + x * (1.0f / 24))));
  const float along = std::copysign(steep, slope);
  return {std::abs(x) < kNearlyOne ? 1.0f : s,
          std::clamp(slope * (0.5f + 0.2892f * curve - 0.0667f * far_curve) +
                         bend * (0.0676f + 0.1392f * curve) - 0.0654f * along,
                     -kLargestGrowth, kLargestGrowth),
          std::clamp(slope * (0.5f * static_cast<float>(kDrift) + 0.0457f * curve) + 0.0033f * bend +
                         0.0189f * along,
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

/// Stretch of the nodes of a row.
struct StretchRow {
  float *factor, *growth, *drift;
};

/// Finds the stretches of `count` nodes that follow `at` in memory, along the axis of `stride`. Each has
/// three neighbours on either side. The same bits as stretchOf(extentsOnLine()) would give. Any thread; never
/// allocates.
void stretchNodes(const NodePositions& nodes, ptrdiff_t at, ptrdiff_t stride, size_t count,
                  const StretchRow& out, StretchFit fit = StretchFit::kSteep);

/// Twice the extents, squared, of five cells in a row.
using SquaredExtents = std::array<double, 5>;

/// The squared extents around the node `at`, which has `before` neighbours in a row on one side and `after`
/// on the other; more than kStretchReach count as kStretchReach. All zero if it has none.
SquaredExtents extentsOnLine(const NodePositions& nodes, ptrdiff_t at, ptrdiff_t stride, int before,
                             int after);

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
/// cut is fitted to even cells: they are stretched by 0.62 of what a whole cell would be, or a gap would
/// show behind the border. Smallest and largest density in a uniform medium, in one dimension, without this
/// and with it:
///
///     elements of 3 steps (1, 1.6, 1)          0.939 1.007  ->  0.972 1.004
///     elements of 5 steps                      0.904 1.012  ->  0.957 1.010
///     a cell, then others twice as long        0.909 1.007  ->  0.959 1.007
///     a cell, then others half as long         0.988 1.023  ->  0.987 1.016
inline double stretchAtBorder(double of_whole) {
  constexpr double kShare = 0.62;
  return 1 + kShare * (of_whole - 1);
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
/// Smallest and largest density in a uniform medium, in one dimension, of blocks of even cells and of
/// unlike sizes:
///
///     sizes 1 and          1.5             2               3               4
///     halves as mirrored   0.979 1.029     0.962 1.054     0.921 1.097     0.887 1.137
///     as one row           0.996 1.004     0.992 1.007     0.980 1.026     0.966 1.063
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
