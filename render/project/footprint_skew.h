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

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "render/project/splat_ellipse.h"

namespace curvisplat {

inline constexpr float kSkewStep = 0.01f;

struct FootprintSkew {
  std::array<float, 4> t{};  // t30, t21, t12, t03

  /// Clamped to what 8 bits hold.
  uint32_t pack() const;
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

}  // namespace curvisplat
