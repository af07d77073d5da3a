// One splat under one linear map: the arithmetic at the heart of the projection, without a branch, so that
// loops over it vectorise. DESIGN.md, "Projection"; the identities it rests on are in projection.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>

#include "render/project/kernel.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// A, as in stream/model/splats.h: column n is axis n times (1, l10, l20), (0, 1, l21), (0, 0, 1).
struct Shape {
  float axis0, axis1, axis2;
  float shear10, shear20, shear21;
};

/// A u.
inline glm::vec3 inSpace(const Shape& s, const glm::vec3& u) {
  return {s.axis0 * u.x, s.axis0 * s.shear10 * u.x + s.axis1 * u.y,
          s.axis0 * s.shear20 * u.x + s.axis1 * s.shear21 * u.y + s.axis2 * u.z};
}

/// w: along A's columns.
struct Slope {
  float w0, w1, w2;
};

inline Shape shapeOf(const GeometryArrays<const float>& geometry, size_t i) {
  return {geometry.axis0[i],   geometry.axis1[i],   geometry.axis2[i],
          geometry.shear10[i], geometry.shear20[i], geometry.shear21[i]};
}

inline Slope slopeOf(const VariableArrays<const float>& variable, size_t i) {
  return {variable.slope0[i], variable.slope1[i], variable.slope2[i]};
}

/// Two rows of a linear map, data to pixels.
struct ScreenRows {
  float x0, y0, z0;  // pixels to the right per unit of x, y, z
  float x1, y1, z1;  // pixels down
};

/// The part of a ScreenSplat that does not depend on where it is.
struct Ellipse {
  float l11, l21, l22, amplitude, slope0, slope1, half_width;
};

/// What is added to covariances on the screen, in pixels²: to the footprint's, and to that which gives the slope.
struct LowPass {
  float footprint_px2, slope_px2;
};

/// `volume`: V times the map's determinant, depth included; pixels² times length.
[[gnu::always_inline]] inline Ellipse ellipseOf(const ScreenRows& p, const Shape& s, const Slope& w,
                                                float variance, float volume, const LowPass& low_pass) {
  const float low_pass_px2 = low_pass.footprint_px2, slope_low_pass_px2 = low_pass.slope_px2;
  // B = P A, by rows.
  const float b00 = s.axis0 * (p.x0 + p.y0 * s.shear10 + p.z0 * s.shear20);
  const float b01 = s.axis1 * (p.y0 + p.z0 * s.shear21);
  const float b02 = s.axis2 * p.z0;
  const float b10 = s.axis0 * (p.x1 + p.y1 * s.shear10 + p.z1 * s.shear20);
  const float b11 = s.axis1 * (p.y1 + p.z1 * s.shear21);
  const float b12 = s.axis2 * p.z1;

  const float s00 = b00 * b00 + b01 * b01 + b02 * b02;
  const float s01 = b00 * b10 + b01 * b11 + b02 * b12;
  const float s11 = b10 * b10 + b11 * b11 + b12 * b12;
  const float n0 = b01 * b12 - b02 * b11, n1 = b02 * b10 - b00 * b12, n2 = b00 * b11 - b01 * b10;
  const float nn = n0 * n0 + n1 * n1 + n2 * n2;  // det S2
  const float determinant = nn + low_pass_px2 * (s00 + s11 + low_pass_px2);
  const float slope_determinant = nn + slope_low_pass_px2 * (s00 + s11 + slope_low_pass_px2);

  Ellipse e;
  e.l11 = std::sqrt(s00 + low_pass_px2);
  e.l21 = s01 / e.l11;
  const float root = std::sqrt(determinant);
  e.l22 = root / e.l11;
  e.amplitude = volume / root;

  // The scalar's gradient on the screen, per pixel, from h2 = B w. By n × w, not by S2's elements: for a long
  // thin splat its rounding error then points across the splat, where it does no harm.
  const float m0 = n1 * w.w2 - n2 * w.w1, m1 = n2 * w.w0 - n0 * w.w2, m2 = n0 * w.w1 - n1 * w.w0;
  const float h0 = b00 * w.w0 + b01 * w.w1 + b02 * w.w2;
  const float h1 = b10 * w.w0 + b11 * w.w1 + b12 * w.w2;
  const float g0 = (b10 * m0 + b11 * m1 + b12 * m2 + slope_low_pass_px2 * h0) / slope_determinant;
  const float g1 = (slope_low_pass_px2 * h1 - (b00 * m0 + b01 * m1 + b02 * m2)) / slope_determinant;
  e.slope0 = e.l11 * g0 + e.l21 * g1;
  e.slope1 = e.l22 * g1;

  // What the screen does not see of the slope lies along the ray. At the least it is w's part along n; where
  // the ellipse is a line to float's precision, n is noise.
  const float wn = w.w0 * n0 + w.w1 * n1 + w.w2 * n2;
  const float along = nn > 1e-8f * s00 * s11 ? wn * wn / nn : 0.0f;
  const float hidden = w.w0 * w.w0 + w.w1 * w.w1 + w.w2 * w.w2 - (h0 * g0 + h1 * g1);
  constexpr auto kKernelVariance = static_cast<float>(kKernelSigma * kKernelSigma);
  e.half_width = std::sqrt(3.0f * (kKernelVariance * std::max(hidden, along) + variance));
  return e;
}

}  // namespace curvisplat
