// What the projection hands to the painters: splats as ellipses on the screen, and what faces leave of them.
// Every record takes 40 bytes.
#pragma once

#include <array>
#include <cstdint>

namespace curvisplat {

/// One splat as the painters take it. With d the offset of a pixel's centre from (x, y) in pixels and u the
/// solution of L u = d, L = | l11 0; l21 l22 | (S2 and the low-pass = L Lᵀ): rho² = |u|², optical depth per
/// unit of extinction = amplitude F(rho), scalar = mean + slope·u, spread evenly over ± half_width around
/// that.
struct ScreenSplat {
  float x, y;            // pixels from the left and the top
  float l11, l21, l22;   // pixels
  float amplitude;       // stretched units of length
  float mean;            // the scalar's unit, and so for the rest
  float slope0, slope1;  // along the columns of L
  float half_width;      // √3 deviations along the ray at rho = 0; in lit pictures with the light (light.h)
};
static_assert(sizeof(ScreenSplat) == 40);

/// The faces that a splat is cut at: a record of its own, directly before the splat where splats come from the
/// nearest to the farthest, and directly behind it where they come from the farthest to the nearest. The
/// splat's amplitude is then negative: minus what it would be.
///
/// Along the ray of a pixel the splat lies about its middle with a distribution of deviation 1: the
/// biweight's, b(x) = 15 / (16 √7) (1 - x²/7)², |x| <= √7. A face leaves what is nearer than, or farther
/// than, a = faces[n][0] + (faces[n][1], faces[n][2]) · u deviations before, or behind, the middle; all faces
/// together an interval [lo, hi]. What is left of the optical depth is the interval's share M of the
/// distribution; and with its mean m and variance v, the scalar's mean changes by k m and its variance by -k²
/// (1 - v), where k = correlation half_width / √3.
struct ScreenCut {
  static constexpr int kFaces = 3;

  std::array<std::array<float, 3>, kFaces> faces{{{kNoFace, 0, 0}, {kNoFace, 0, 0}, {kNoFace, 0, 0}}};
  uint32_t far_sides = 0;  // bit n: face n leaves what is farther, x >= -a; else x <= a
  float correlation = 0;   // of scalar and depth along the ray, -1 to 1, as the faces see it

  static constexpr float kNoFace = 4;          // > √7
  static constexpr float kReach = 2.6457513f;  // √7

  /// As a record among splats, which isCut() tells from splats, and back.
  ScreenSplat record() const;
  static ScreenCut of(const ScreenSplat& record);
};

/// Whether a record is a ScreenCut.
inline bool isCut(const ScreenSplat& record) {
  return record.l11 < 0;
}
/// Whether a splat has a ScreenCut.
inline bool hasCut(const ScreenSplat& splat) {
  return splat.amplitude < 0 && !isCut(splat);
}

// l11 holds all that is not a face: -(4 far_sides + 2 + correlation).
inline ScreenSplat ScreenCut::record() const {
  const auto& f = faces;
  return {f[0][0], f[0][1], -(4 * static_cast<float>(far_sides) + 2 + correlation),
          f[0][2], f[1][0], f[1][1],
          f[1][2], f[2][0], f[2][1],
          f[2][2]};
}
inline ScreenCut ScreenCut::of(const ScreenSplat& r) {
  ScreenCut cut;
  cut.faces = {{{r.x, r.y, r.l21}, {r.l22, r.amplitude, r.mean}, {r.slope0, r.slope1, r.half_width}}};
  cut.far_sides = static_cast<uint32_t>(-0.25f * r.l11);
  cut.correlation = -r.l11 - 4 * static_cast<float>(cut.far_sides) - 2;
  return cut;
}

}  // namespace curvisplat
