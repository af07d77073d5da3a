// How much longer than its cell a splat is along each lattice axis, and how cells grow along it, so that a uniform
// medium looks uniform where the sizes of neighbouring cells differ.
//
// Boxes tile space, and boxes that are convolved with one common blur still sum to one everywhere. Along an
// axis where the cell's extent is h, the kernel's variance is 0.1994 h² = h²/12 + 0.1161 h². The first part
// is the box, the second is the blur: 58.2 % of the variance, which must vary slowly from cell to cell. So
// the splat's extent is s h, with
//
//     s² = 0.418 + 0.582 (ĥ/h)²      ĥ: the extents along the axis's grid line, smoothed: their geometric
//                                    mean with weights 1 4 6 4 1, two passes of [1 2 1]/4 over ln h
//
// Cells that grow by a constant factor keep their extents, whatever the factor, since their ln h is linear.
// Only changes of the growth count: at the borders of spectral elements, say. What steady growth needs is a kernel
// that is skewed (stream/model/growth_code.h): by g, the slope of ln h over the same five extents,
// smoothed: their differences with weights -1 -2 0 2 1, over 8.
//
// A line ends at a block's face and beside a missing cell. There the extents are mirrored, less their steady
// growth: the smaller of the two growths next to the end, 1 where they disagree or the line is short.
//
// Rejected: smoothing the matrices S of the neighbours along all three axes, which is as good on spectral
// elements (ripple of 1.34 % and 1.22 %, for 1.36 % and 1.24 % this way), makes curved boundary layers
// thicker (the neighbours' long axes lean out of the layer) and harms cells that grow by 1.25 or more (1.1 to
// 1.6 % on a dome of 1.25, 1.7 to 2.1 % at 1.5); the arithmetic mean of h², which has the latter fault too;
// four passes (no gain).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace curvisplat {

/// How far along a line the samples reach that determine s, on either side.
inline constexpr int kStretchReach = 4;

/// s from the squared extents of five cells in a row, the third of which is the splat's own. Between 0.81 and
/// 1.35; 1 where it is nearly 1 (a stored shape cannot be told from it) or a cell has no extent.
inline float stretchOf(double before2, double before, double own, double after, double after2) {
  constexpr float kLargest = 32;       // of (ĥ/h)⁸: what a jump of the sizes may do
  constexpr float kNearlyOne = 4e-4f;  // of s²
  const double per_own2 = 1 / (own * own);
  const double near = before * after * per_own2, far = before2 * after2 * per_own2;
  const bool usable = near > 0 && far > 0 && near < 1e30 && far < 1e30;
  // Single precision: it is quicker, and bits do not depend on vector instructions.
  const float near_ratio = usable ? static_cast<float>(near) : 1.0f;
  const float far_ratio = usable ? static_cast<float>(far) : 1.0f;
  const float smoothed8 = std::clamp(near_ratio * std::sqrt(std::sqrt(far_ratio)), 1 / kLargest, kLargest);
  const float squared = 0.418f + 0.582f * std::sqrt(std::sqrt(smoothed8));
  return std::abs(squared - 1) < kNearlyOne ? 1.0f : std::sqrt(squared);
}

/// g, from the same squared extents but the splat's own; 0 where a cell has no extent. To 0.001 up to growths by 1.9,
/// which is the most it gives.
inline float growthOf(double before2, double before, double after, double after2) {
  constexpr float kMost = 3e4f;  // exp(16 g) of that
  const double product = after2 * after * after, per = before2 * before * before;
  const bool usable = product > 0 && per > 0 && product < 1e300 && per < 1e300;
  const double exact = usable ? product / per : 1.0;
  const auto ratio = static_cast<float>(std::clamp(exact, 1.0 / kMost, 1.0 * kMost));
  const float growth2 = std::sqrt(std::sqrt(std::sqrt(ratio)));  // exp(2 g)
  const float t = (growth2 - 1) / (growth2 + 1), t2 = t * t;     // tanh g
  return t * (1 + t2 * (1.0f / 3 + t2 * (1.0f / 5 + t2 * (1.0f / 7))));
}

/// How far a splat lies from its cell's middle towards the larger cells, in the cell's length and for g = 1. Blurs that widen with
/// the cells carry more from each into the smaller ones than they get back: a medium is 1 + 0.14 g² too dense, 2.4 % at a
/// growth by 1.5, unless splats move by half the slope of the blur's variance (0.1161 h²) and the skew's part.
inline constexpr double kDrift = 0.14;

/// What the extents along an axis tell of a splat.
struct Stretch {
  float factor = 1;  // s
  float growth = 0;  // g
};

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

/// Of `count` nodes that follow `at` in memory, along the axis of `stride`: [count] each. Each has three neighbours on
/// either side. The same bits as stretchOnLine() would give. Any thread; never allocates.
void stretchNodes(const NodePositions& nodes, ptrdiff_t at, ptrdiff_t stride, size_t count, float* factor,
                  float* growth);

/// Of the node `at`, which has `before` neighbours in a row on one side and `after` on the other; more than
/// kStretchReach count as kStretchReach.
Stretch stretchOnLine(const NodePositions& nodes, ptrdiff_t at, ptrdiff_t stride, int before, int after);

}  // namespace curvisplat
