// The planes that thin splats lie in, as the order of splats needs them (tile_key.h).
//
// At a pixel d from its centre a splat has its mean depth at z(d) = z + s·d, s = (S_xz, S_yz) S_xy⁻¹: for a
// thin splat, the plane that it lies in. In a tile that a splat does not reach across, what counts is the
// plane that it shares with its neighbours, the layer: m, the mean of their s. So with r how far the splat
// reaches, and h the half of a tile's side, its slope is m + (s - m) min(1, r / h).
//
// Where neighbours are about as thick along the ray as they lean, or lie in all directions, as in meshes,
// their planes order nothing; the slope is 0, and they are ordered by their centres. Splats count as
// neighbours that come one after the other in their brick. All in pixels; in the loop over a brick's splats,
// without a branch. DESIGN.md, "Order".
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "render/project/footprint.h"
#include "render/project/screen_view.h"
#include "render/project/tile_key.h"

namespace curvisplat {

/// Pixels of depth a pixel to the right, and down.
struct PlaneSlope {
  float x = 0, y = 0;
};

/// The planes of some splats that follow one another.
class PlaneBlock {
 public:
  static constexpr size_t kMaxSplats = 256;

  /// Sets splat n, under the map to pixels and that to pixels of depth.
  [[gnu::always_inline]] inline void fill(size_t n, const ScreenRows& p, const glm::vec3& depth,
                                          const Shape& s);
  /// Finds the slopes of splats 0 .. count - 1.
  [[gnu::always_inline]] inline void find(size_t count);
  PlaneSlope of(size_t n) const { return {slope_x_[n], slope_y_[n]}; }

 private:
  static constexpr size_t kNeighbours = 8;
  // Of the part of the depth's variance that the common plane explains, over the rest.
  static constexpr float kMinExplained = 0.5f;

  [[gnu::always_inline]] inline void findCommon(size_t begin, size_t end);

  float slope_x_[kMaxSplats], slope_y_[kMaxSplats];
  float common_x_[kMaxSplats], common_y_[kMaxSplats];
  float own_[kMaxSplats];   // how much of a splat's own slope counts
  float area_[kMaxSplats];  // of its shadow on the screen, but for a factor
  float xx_[kMaxSplats], xy_[kMaxSplats], yy_[kMaxSplats], xz_[kMaxSplats], yz_[kMaxSplats], zz_[kMaxSplats];
};

inline void PlaneBlock::fill(size_t n, const ScreenRows& p, const glm::vec3& depth, const Shape& s) {
  const float b00 = s.axis0 * (p.x0 + p.y0 * s.shear10 + p.z0 * s.shear20);
  const float b01 = s.axis1 * (p.y0 + p.z0 * s.shear21), b02 = s.axis2 * p.z0;
  const float b10 = s.axis0 * (p.x1 + p.y1 * s.shear10 + p.z1 * s.shear20);
  const float b11 = s.axis1 * (p.y1 + p.z1 * s.shear21), b12 = s.axis2 * p.z1;
  const float q0 = s.axis0 * (depth.x + depth.y * s.shear10 + depth.z * s.shear20);
  const float q1 = s.axis1 * (depth.y + depth.z * s.shear21), q2 = s.axis2 * depth.z;
  const float xx = b00 * b00 + b01 * b01 + b02 * b02, yy = b10 * b10 + b11 * b11 + b12 * b12;
  const float xz = b00 * q0 + b01 * q1 + b02 * q2, yz = b10 * q0 + b11 * q1 + b12 * q2;
  xx_[n] = xx;
  xy_[n] = b00 * b10 + b01 * b11 + b02 * b12;
  yy_[n] = yy;
  xz_[n] = xz;
  yz_[n] = yz;
  zz_[n] = q0 * q0 + q1 * q1 + q2 * q2;
  // As the scalar's slope in ellipseOf().
  constexpr auto kEpsilon = static_cast<float>(kSlopeLowPass);
  const float n0 = b01 * b12 - b02 * b11, n1 = b02 * b10 - b00 * b12, n2 = b00 * b11 - b01 * b10;
  const float m0 = n1 * q2 - n2 * q1, m1 = n2 * q0 - n0 * q2, m2 = n0 * q1 - n1 * q0;
  const float nn = n0 * n0 + n1 * n1 + n2 * n2;
  const float inverse = 1 / (nn + kEpsilon * (xx + yy + kEpsilon));
  slope_x_[n] = inverse * (b10 * m0 + b11 * m1 + b12 * m2 + kEpsilon * xz);
  slope_y_[n] = inverse * (kEpsilon * yz - (b00 * m0 + b01 * m1 + b02 * m2));
  area_[n] = std::sqrt(nn);
  constexpr auto kReach = static_cast<float>(2 * kKernelSupport / kOrderSide);
  own_[n] = std::min(1.0f, kReach * area_[n] / std::sqrt(xx + yy + 1e-30f));
}

/// The mean of their slopes, by the areas of their shadows: one seen edge-on has a slope without bounds.
inline void PlaneBlock::findCommon(size_t begin, size_t end) {
  float x = 0, y = 0, area = 1e-30f, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;
  for (size_t n = begin; n < end; ++n) {
    x += area_[n] * slope_x_[n];
    y += area_[n] * slope_y_[n];
    area += area_[n];
    xx += xx_[n];
    xy += xy_[n];
    yy += yy_[n];
    xz += xz_[n];
    yz += yz_[n];
    zz += zz_[n];
  }
  x /= area;
  y /= area;
  const float explained = x * x * xx + 2 * x * y * xy + y * y * yy;
  const float rest = zz - 2 * (x * xz + y * yz) + explained;
  const bool is_plane = explained > kMinExplained * rest;
  for (size_t n = begin; n < end; ++n) {
    common_x_[n] = x;
    common_y_[n] = y;
    own_[n] = is_plane ? own_[n] : -1;
  }
}

inline void PlaneBlock::find(size_t count) {
  for (size_t n = 0; n < count; n += kNeighbours) findCommon(n, std::min(n + kNeighbours, count));
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const float own = own_[n];
    const float x = common_x_[n] + own * (slope_x_[n] - common_x_[n]);
    const float y = common_y_[n] + own * (slope_y_[n] - common_y_[n]);
    const float steep = std::sqrt(x * x + y * y);
    const float factor = steep > kSteepest ? kSteepest / steep : 1.0f;
    const bool leans = (own >= 0) & (steep < 1e30f);
    slope_x_[n] = leans ? factor * x : 0.0f;
    slope_y_[n] = leans ? factor * y : 0.0f;
  }
}

}  // namespace curvisplat
