// The skew of a footprint: what a skewed kernel (stream/model/growth_code.h) leaves along a ray. DESIGN.md, "Projection".
//
// With v = u / σ on the screen (screen_splat.h has u) and p_a the image of the lattice's unit vector ê_a in that
// measure, |p_a| <= 1, a Gram-Charlier series keeps its form when it is integrated along the ray:
//
//     F(u) max(0, 1 + Σ_a γ_a ((p_a · v)³ - 3 |p_a|² p_a · v) / 6)      γ_a = kSkewOfGrowth g_a
//
// which depends on four numbers, those of the symmetric tensor T = Σ γ_a p_a p_a p_a: t30, t21, t12, t03. The linear
// part is -3 (t30 + t12, t21 + t03). They are kept in 8 bits each, the lowest t30's, in steps of 1/100.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "render/project/splat_ellipse.h"
#include "stream/model/growth_code.h"

namespace curvisplat {

inline constexpr float kSkewStep = 0.01f;

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

/// Of a splat of this shape.
GrowthAxes growthAxes(const Shape& shape, uint32_t growth_code);

/// As the ellipse has it under `rows`, packed.
uint32_t skewOf(const ScreenRows& rows, const GrowthAxes& axes, const Ellipse& ellipse);

/// L of an ellipse.
struct LowerTriangle {
  float l11, l21, l22;
};

/// The growth of the cells of many splats: an array for each number, so that a loop over skewOf() vectorises.
class GrowthBlock {
 public:
  static constexpr size_t kMaxSplats = 256;  // splats

  /// False if the cells of none grow.
  bool fill(std::span<const uint32_t> growth_codes);
  /// As skewOf() with growthAxes() gives it, of number `n` of those filled in.
  [[gnu::always_inline]] uint32_t skewOf(size_t n, const ScreenRows& rows, const Shape& shape,
                                         const LowerTriangle& l) const;

 private:
  struct Axis {
    std::array<float, kMaxSplats> x, y, z, growth;
  };
  std::array<Axis, 3> axes_;
};

// Inline, for the loop over a brick's splats.

inline uint32_t FootprintSkew::pack() const {
  // Rounds as std::nearbyint(), which is a call; the lowest bits of the sum are then those of the integer, and 0 of NaN.
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

}  // namespace curvisplat
