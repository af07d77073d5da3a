// How much longer than its cell a splat is along each lattice axis, how it is skewed there, and how far it is
// from the cell's middle, so that a uniform medium looks uniform where the sizes of neighbouring cells differ.
//
// Boxes tile space, and boxes that are convolved with one common blur still sum to one everywhere. A kernel is a
// box, of 41.8 % of its variance, and a blur, which must vary slowly from cell to cell: so a splat is wider than
// a cell that is small for its neighbours, and skewed where cells grow (stream/model/growth_code.h). With the
// logarithms l of five extents along the axis's grid line, less that of the splat's own cell,
//
//     curve = l(-1) + l(1)    far_curve = l(-2) + l(2)    slope = l(1) - l(-1)    bend = l(2) - l(-2) - 2 slope
//
//     ln s  = 0.1531 curve + 0.0828 curve² - 0.0418 bend slope         s: the splat's length over the cell's
//     g     = slope (1/2 + 0.2892 curve - 0.0667 far_curve) + bend (0.0676 + 0.1392 curve)
//     drift = slope (0.07 + 0.0457 curve) + 0.0033 bend                towards the larger cells, in cells
//
// Where cells grow by a constant factor e^g only `slope` is not zero: s is 1, and the drift 0.14 g. That makes up
// for blurs that widen with the cells, which carry more from each into the smaller ones than they get back: a
// medium would be 1 + 0.14 g² too dense. The other numbers are by least squares over lines in one dimension:
// Gauss-Lobatto elements, growing elements, tanh spacing in blocks, jumps, random walks. Of six forms that were
// fitted the one was kept that served the real grids of bench/README.md best, nek above all. p98/p2 of the density
// in a uniform medium, with these, and with s² = 0.418 + 0.582 (ĥ/h)², ĥ the geometric mean with weights 1 4 6 4 1,
// g the slope of ln h over the same five, and 0.14 g:
//
//     elements of 4, 5, 6, 7, 9 steps       1.008 1.021 1.020 1.022 1.027       1.047 1.050 1.054 1.057 1.063
//     3, 5, 7 steps, elements growing 1.42  1.016 1.025 1.028                   1.035 1.056 1.062
//     tanh, blocks of 8, three strengths    1.044 1.058 1.070                   1.079 1.107 1.139
//     jumps by 1.5, by 2                    1.005 1.011                         1.010 1.025
//
// A line ends at a block's face and beside a missing cell. There the extents are mirrored, less their steady
// growth: the smaller of the two growths next to the end, 1 where they disagree or the line is short.
//
// Rejected: smoothing the matrices S of the neighbours along all three axes, which is as good on spectral
// elements (ripple of 1.34 % and 1.22 %, for 1.36 % and 1.24 % this way), makes curved boundary layers
// thicker (the neighbours' long axes lean out of the layer) and harms cells that grow by 1.25 or more (1.1 to
// 1.6 % on a dome of 1.25, 1.7 to 2.1 % at 1.5); the arithmetic mean of h², which has the latter fault too;
// four passes (no gain); weights that flow to smaller cells (no gain in such fits); a drift in proportion to g (gains half as much).
#pragma once

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

/// What the extents along an axis tell of a splat.
struct Stretch {
  float factor = 1;  // s: between 0.74 and 1.57
  float growth = 0;  // g
  float drift = 0;
};

/// ln √x of a positive number, to 1e-6. Single precision: it is quicker, and bits do not depend on vector instructions.
[[gnu::always_inline]] inline float halfLogarithm(float x) {
  constexpr uint32_t kRootOfHalf = 0x3f3504f3;
  const auto bits = std::bit_cast<uint32_t>(x);
  const int32_t power = static_cast<int32_t>(bits - kRootOfHalf) >> 23;
  const float part = std::bit_cast<float>(bits - (static_cast<uint32_t>(power) << 23));
  const float t = (part - 1) / (part + 1), t2 = t * t;
  return 0.34657359f * static_cast<float>(power) + t * (1 + t2 * (1.0f / 3 + t2 * (1.0f / 5)));
}

/// From the squared extents of five cells in a row, the third of which is the splat's own. s is 1 where it is nearly 1 (a stored
/// shape cannot be told from it); all is as in an even grid where a cell has no extent.
[[gnu::always_inline]] inline Stretch stretchOf(double before2, double before, double own, double after,
                                                double after2) {
  constexpr float kNearlyOne = 2e-4f;
  constexpr double kLargest = 1e6;  // of squared ratios
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
  const float x = std::clamp(curve * (0.1531f + 0.0828f * curve) - 0.0418f * (bend * slope), -0.3f, 0.45f);
  const float s = 1 + x * (1 + x * (1.0f / 2 + x * (1.0f / 6 + x * (1.0f / 24))));
  return {
      std::abs(x) < kNearlyOne ? 1.0f : s,
      std::clamp(slope * (0.5f + 0.2892f * curve - 0.0667f * far_curve) + bend * (0.0676f + 0.1392f * curve),
                 -0.65f, 0.65f),
      std::clamp(slope * (0.5f * static_cast<float>(kDrift) + 0.0457f * curve) + 0.0033f * bend, -0.125f,
                 0.125f)};
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

/// Of `count` nodes that follow `at` in memory, along the axis of `stride`. Each has three neighbours on either side. The same
/// bits as stretchOf(extentsOnLine()) would give. Any thread; never allocates.
void stretchNodes(const NodePositions& nodes, ptrdiff_t at, ptrdiff_t stride, size_t count,
                  const StretchRow& out);

/// Twice the extents, squared, of five cells in a row.
using SquaredExtents = std::array<double, 5>;

/// Around the node `at`, which has `before` neighbours in a row on one side and `after` on the other; more than kStretchReach
/// count as kStretchReach. All zero if it has none.
SquaredExtents extentsOnLine(const NodePositions& nodes, ptrdiff_t at, ptrdiff_t stride, int before,
                             int after);

inline Stretch stretchOf(const SquaredExtents& e) {
  return stretchOf(e[0], e[1], e[2], e[3], e[4]);
}

}  // namespace curvisplat
