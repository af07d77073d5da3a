// The image of a splat on the screen: the footprint F of its kernel K, an ellipse under a linear map, the
// skew of the ellipse where the cells around the splat grow, and the box around it. DESIGN.md, "Splats" and
// "Projection"; Crawfis and Max, "Texture Splats for 3D Scalar and Vector Field Visualization", 1993.
//
// K and F are in units of the grid spacing, and are computed in double precision for tables. Ellipses and
// skews are the arithmetic at the heart of the projection, a splat under a map: in float, inline and without
// a branch, so that loops over them vectorise. The identities that they rest on are in projection.h. Pure;
// any thread.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"
#include "stream/model/growth_code.h"
#include "stream/model/kernel.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// K(r), r >= 0; zero from kKernelSupport on, as F is. Its integral over space is 1.
double kernel(double r);

/// F(rho) = ∫ K(√(rho² + t²)) dt, rho >= 0: the integral of a splat's kernel along a ray that passes its
/// centre at the distance rho. Computed by quadrature.
double footprint(double rho);

/// F at equal steps of rho² over [0, kKernelSupport²]: [steps + 1]. F is smooth in rho², and a table over
/// rho² needs no square root when drawing. Linear interpolation is accurate to 1e-5 with 1024 steps or more.
std::vector<double> footprintTable(int steps);

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
  float l11, l21, l22, amplitude, slope0, slope1, half_width, along;
};

/// The low-pass that is added to covariances on the screen, in pixels²: to the footprint's, and to that which
/// gives the slope.
struct LowPass {
  float footprint_px2, slope_px2;
};

/// The ellipse of a splat under the linear map `p`. `volume`: V times the map's determinant, depth included;
/// pixels² times length.
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

  // The scalar's gradient on the screen, per pixel, from h2 = B w. By n × w, not by S2's elements: for a
  // long thin splat its rounding error then points across the splat, where it does no harm.
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
  const float along2 = nn > 1e-8f * s00 * s11 ? wn * wn / nn : 0.0f;
  const float hidden = w.w0 * w.w0 + w.w1 * w.w1 + w.w2 * w.w2 - (h0 * g0 + h1 * g1);
  constexpr auto kKernelVariance = static_cast<float>(kKernelSigma * kKernelSigma);
  e.half_width = std::sqrt(3.0f * (kKernelVariance * std::max(hidden, along2) + variance));
  e.along = std::copysign(static_cast<float>(kKernelSigma) * std::sqrt(along2), wn);
  return e;
}

/// A packed skew has its numbers in steps of this.
inline constexpr float kSkewStep = 0.01f;

/// The skew of a footprint: what a skewed kernel (stream/model/growth_code.h) leaves along a ray.
///
/// With v = u / σ on the screen (screen_splat.h has u) and p_a the image of the lattice's unit vector ê_a in
/// that measure, |p_a| <= 1, a Gram-Charlier series keeps its form when it is integrated along the ray:
///
///     F(u) max(0, 1 + Σ_a γ_a ((p_a · v)³ - 3 |p_a|² p_a · v) / 6)      γ_a = kSkewOfGrowth g_a
///
/// which depends on four numbers, those of the symmetric tensor T = Σ γ_a p_a p_a p_a: t30, t21, t12, t03.
/// The linear part is -3 (t30 + t12, t21 + t03). They are kept in 8 bits each, the lowest t30's.
struct FootprintSkew {
  std::array<float, 4> t{};  // t30, t21, t12, t03

  /// Clamped to what 8 bits hold.
  [[gnu::always_inline]] inline uint32_t pack() const;
  static FootprintSkew unpack(uint32_t skew);
  /// The factor at u.
  double at(double u0, double u1) const;
};

/// The axes that a splat's cells grow along: A ê_a, ê_a and g_a.
struct GrowthAxes {
  std::array<glm::vec3, 3> along, unit;
  std::array<float, 3> growth;
  size_t count = 0;
};

/// The axes of a splat of this shape.
GrowthAxes growthAxes(const Shape& shape, uint32_t growth_code);

/// The skew that the ellipse has under `rows`, packed.
uint32_t skewOf(const ScreenRows& rows, const GrowthAxes& axes, const Ellipse& ellipse);

/// L of an ellipse.
struct LowerTriangle {
  float l11, l21, l22;
};

/// The growth of the cells of many splats: an array for each number, so that a loop over skewOf()
/// vectorises.
class GrowthBlock {
 public:
  static constexpr size_t kMaxSplats = 256;

  /// Returns false if no splat's cells grow.
  bool fill(std::span<const uint32_t> growth_codes);
  /// The skew of number `n` of those filled in: what skewOf() gives with growthAxes().
  [[gnu::always_inline]] uint32_t skewOf(size_t n, const ScreenRows& rows, const Shape& shape,
                                         const LowerTriangle& l) const;

 private:
  struct Axis {
    std::array<float, kMaxSplats> x, y, z, growth;
  };
  std::array<Axis, 3> axes_;
};

// These are inline for the loop over a brick's splats.

inline uint32_t FootprintSkew::pack() const {
  // Rounds as std::nearbyint(), which is a call; the lowest bits of the sum are then those of the integer,
  // and 0 of NaN.
  constexpr float kShift = 0x1.8p23f;
  uint32_t skew = 0;
  for (size_t n = 0; n < 4; ++n) {
    const float shifted = std::clamp(t[n] * (1 / kSkewStep), -127.0f, 127.0f) + kShift;
    skew |= (std::bit_cast<uint32_t>(shifted) & 0xff) << 8 * n;
  }
  return skew;
}

/// The part that an axis adds, `along` in space.
[[gnu::always_inline]] inline std::array<float, 4> skewOfAxis(const ScreenRows& rows, const glm::vec3& along,
                                                              float growth, const LowerTriangle& l) {
  const float p0 = (rows.x0 * along.x + rows.y0 * along.y + rows.z0 * along.z) / l.l11;
  const float p1 = (rows.x1 * along.x + rows.y1 * along.y + rows.z1 * along.z - l.l21 * p0) / l.l22;
  const float gamma = kSkewOfGrowth * growth;
  return {gamma * p0 * p0 * p0, gamma * p0 * p0 * p1, gamma * p0 * p1 * p1, gamma * p1 * p1 * p1};
}

inline uint32_t GrowthBlock::skewOf(size_t n, const ScreenRows& rows, const Shape& shape,
                                    const LowerTriangle& l) const {
  FootprintSkew skew;
  for (const Axis& axis : axes_) {
    const float growth = axis.growth[n];
    const std::array<float, 4> added =
        skewOfAxis(rows, inSpace(shape, {axis.x[n], axis.y[n], axis.z[n]}), growth, l);
    for (size_t t = 0; t < 4; ++t) skew.t[t] += growth == 0 ? 0.0f : added[t];
  }
  return skew.pack();
}

/// The rectangle of the screen that a splat's footprint fills, in pixels. Not for records (isRecord).
inline ScreenBox footprintBox(const ScreenSplat& splat) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float reach_x = kSupport * splat.l11;
  const float reach_y = kSupport * (std::abs(splat.l21) + splat.l22);
  return {splat.x - reach_x, splat.y - reach_y, splat.x + reach_x, splat.y + reach_y};
}

}  // namespace curvisplat
