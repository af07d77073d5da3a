// The planes that thin splats lie in, as the order of splats needs them (tile_key.h).
//
// At a pixel d from its centre a splat has its mean depth at z(d) = z + s·d, s = (S_xz, S_yz) S_xy⁻¹: for a
// thin splat, the plane that it lies in. Where that explains less than two thirds of the variance of its depths,
// since the cell is about as thick along the ray as it leans, its order changes nothing: the slope is 0, and it is
// ordered by its centre. All in pixels; in the loop over a brick's splats, without a branch. DESIGN.md, "Order".
#pragma once

#include <glm/vec3.hpp>

#include <cmath>
#include <cstddef>

#include "render/project/footprint.h"
#include "render/project/tile_key.h"

namespace curvisplat {

/// Pixels of depth a pixel to the right, and down.
struct PlaneSlope {
  float x = 0, y = 0;
};

/// The planes of some splats.
class PlaneBlock {
 public:
  static constexpr size_t kMaxSplats = 256;

  /// Sets splat n, under the map to pixels and that to pixels of depth.
  [[gnu::always_inline]] inline void fill(size_t n, const ScreenRows& p, const glm::vec3& depth,
                                          const Shape& s);
  PlaneSlope of(size_t n) const { return {slope_x_[n], slope_y_[n]}; }

 private:
  // The least ratio of the depth's variance that the plane explains to the rest of it.
  static constexpr float kMinExplained = 2;

  float slope_x_[kMaxSplats], slope_y_[kMaxSplats];
};

inline void PlaneBlock::fill(size_t n, const ScreenRows& p, const glm::vec3& depth, const Shape& s) {
  const float b00 = s.axis0 * (p.x0 + p.y0 * s.shear10 + p.z0 * s.shear20);
  const float b01 = s.axis1 * (p.y0 + p.z0 * s.shear21), b02 = s.axis2 * p.z0;
  const float b10 = s.axis0 * (p.x1 + p.y1 * s.shear10 + p.z1 * s.shear20);
  const float b11 = s.axis1 * (p.y1 + p.z1 * s.shear21), b12 = s.axis2 * p.z1;
  const float q0 = s.axis0 * (depth.x + depth.y * s.shear10 + depth.z * s.shear20);
  const float q1 = s.axis1 * (depth.y + depth.z * s.shear21), q2 = s.axis2 * depth.z;
  const float xx = b00 * b00 + b01 * b01 + b02 * b02, yy = b10 * b10 + b11 * b11 + b12 * b12;
  const float xy = b00 * b10 + b01 * b11 + b02 * b12;
  const float xz = b00 * q0 + b01 * q1 + b02 * q2, yz = b10 * q0 + b11 * q1 + b12 * q2;
  const float zz = q0 * q0 + q1 * q1 + q2 * q2;
  // Keeps what is seen edge-on finite, and no more: layers are followed over many times their thickness.
  const float epsilon = 1e-6f * (xx + yy) + 1e-20f;
  const float n0 = b01 * b12 - b02 * b11, n1 = b02 * b10 - b00 * b12, n2 = b00 * b11 - b01 * b10;
  const float m0 = n1 * q2 - n2 * q1, m1 = n2 * q0 - n0 * q2, m2 = n0 * q1 - n1 * q0;
  const float nn = n0 * n0 + n1 * n1 + n2 * n2;
  const float inverse = 1 / (nn + epsilon * (xx + yy + epsilon));
  const float x = inverse * (b10 * m0 + b11 * m1 + b12 * m2 + epsilon * xz);
  const float y = inverse * (epsilon * yz - (b00 * m0 + b01 * m1 + b02 * m2));
  const float explained = x * x * xx + 2 * x * y * xy + y * y * yy;
  const float rest = zz - 2 * (x * xz + y * yz) + explained;
  const float steep = std::sqrt(x * x + y * y);
  const float held = steep > kSteepest ? kSteepest / steep : 1.0f;
  const bool leans = (explained > kMinExplained * rest) & (steep < 1e30f);
  slope_x_[n] = leans ? held * x : 0.0f;
  slope_y_[n] = leans ? held * y : 0.0f;
}

}  // namespace curvisplat
