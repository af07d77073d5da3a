// The records that the projection passes to the painters: splats as ellipses on the screen; what cuts them:
// faces, and the layers of the pixels; and the scalar of their colours, if it is not that of their opacity.
// Every record takes 64 bytes, a cache line.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "render/project/record_tags.h"

namespace curvisplat {

/// One splat as the painters take it. With d the offset of a pixel's centre from (x, y) in pixels and u the
/// solution of L u = d, L = | l11 0; l21 l22 | (S2 and the low-pass = L Lᵀ): rho² = |u|², optical depth per
/// unit of extinction = amplitude F(rho), but for the skew; scalar = mean + slope·u, spread evenly over ±
/// half_width around that.
struct ScreenSplat {
  float x, y;            // pixels from the left and the top
  float l11, l21, l22;   // pixels
  float amplitude;       // stretched units of length
  float mean;            // the scalar's unit, and so for the rest
  float slope0, slope1;  // along the columns of L
  float half_width;      // √3 deviations along the ray at rho = 0; in lit pictures with the light (light.h)
  uint32_t skew;         // of the footprint, packed (footprint.h); 0: none
  float along;           // by how much the scalar changes with each deviation of depth along the ray
  // The splat's place in each tile's order (tile_key.h).
  uint32_t key, first;           // in drawing order: at (x, y); the first of any tile's
  float key_slope0, key_slope1;  // keys a pixel to the right, and down
};
static_assert(sizeof(ScreenSplat) == 64);
// Trivial, so that the large buffers of a frame take no memory before they are filled.
static_assert(std::is_trivially_default_constructible_v<ScreenSplat>);

/// The faces that a splat is cut at: a record of its own, directly before the splat where splats come from
/// the nearest to the farthest, and directly behind it where they come from the farthest to the nearest. The
/// splat's amplitude is then negative: minus what it would be. A splat that has a ScreenDepth as well has
/// that beside it, and the ScreenCut beyond.
///
/// Along the ray of a pixel the splat lies about its middle with a distribution of deviation 1: the
/// biweight's, b(x) = 15 / (16 √7) (1 - x²/7)², |x| <= √7. A face leaves what is nearer than, or farther
/// than, a = faces[n][0] + (faces[n][1], faces[n][2]) · u deviations before, or behind, the middle; all
/// faces together an interval [lo, hi]. What is left of the optical depth is the interval's share M of the
/// distribution; and with its mean m and variance v, the scalar's mean changes by k m and its variance by
/// -k² (1 - v), where k = correlation half_width / √3.
struct ScreenCut {
  static constexpr int kFaces = 3;

  std::array<std::array<float, 3>, kFaces> faces{{{kNoFace, 0, 0}, {kNoFace, 0, 0}, {kNoFace, 0, 0}}};
  uint32_t far_sides = 0;  // bit n: face n leaves what is farther, x >= -a; else x <= a
  float correlation = 0;   // of scalar and depth along the ray, -1 to 1, as the faces see it

  static constexpr float kNoFace = 4;          // > √7
  static constexpr float kReach = 2.6457513f;  // √7

  /// Makes a record among splats, which isRecord() tells from splats, and back.
  ScreenSplat record() const;
  static ScreenCut of(const ScreenSplat& record);
};

/// The place of a splat along the ray, for those that may meet the layers of their pixels (pixel_layers.h).
/// The middle's depth at u is middle + by[0] u0 + by[1] u1; a layer at the depth z is (z - that) per_depth
/// deviations behind it. A window between two layers is one more interval that the splat is cut to, together
/// with those of its faces. A splat without this record lies in front of all layers.
struct ScreenDepth {
  float middle = 0;
  std::array<float, 2> by{};
  float per_depth = 1;
  float correlation = 0;  // as ScreenCut's, which it replaces
  bool has_cut = false;   // a ScreenCut lies beyond

  ScreenSplat record() const;
  static ScreenDepth of(const ScreenSplat& record);
};

/// The scalar that a splat takes its colours from, where the opacity is another's: along the columns of L as
/// the splat's own scalar. In pictures of two scalars every splat has one, directly beside it, before any
/// other record.
struct ScreenColour {
  float mean = 0;
  std::array<float, 2> slope{};
  float half_width = 0;
  float correlation = 0;  // of this scalar and depth along the ray, as the cuts see it
  float along = 0;        // as ScreenSplat's

  ScreenSplat record() const;
  static ScreenColour of(const ScreenSplat& record);
};

/// Whether an element is no splat but a record: a ScreenCut, a ScreenDepth or a ScreenColour.
inline bool isRecord(const ScreenSplat& element) {
  return element.l11 < 0;
}
inline bool isColour(const ScreenSplat& element) {
  return hasTagFrom(element.l11, kColourTag);
}
inline bool isDepth(const ScreenSplat& element) {
  return hasTagFrom(element.l11, kDepthTag) && !isColour(element);
}
/// Whether a splat has a ScreenCut, a ScreenDepth, or both.
inline bool hasCut(const ScreenSplat& splat) {
  return splat.amplitude < 0 && !isRecord(splat);
}

// l11 holds all that is not a face.
inline ScreenSplat ScreenCut::record() const {
  const auto& f = faces;
  return {f[0][0], f[0][1], -(kFarSidesTag * static_cast<float>(far_sides) + kCutTag + correlation),
          f[0][2], f[1][0], f[1][1],
          f[1][2], f[2][0], f[2][1],
          f[2][2], 0,       0,
          0,       0,       0,
          0};
}
inline ScreenCut ScreenCut::of(const ScreenSplat& r) {
  ScreenCut cut;
  cut.faces = {{{r.x, r.y, r.l21}, {r.l22, r.amplitude, r.mean}, {r.slope0, r.slope1, r.half_width}}};
  cut.far_sides = static_cast<uint32_t>(-r.l11 / kFarSidesTag);
  cut.correlation = -r.l11 - kFarSidesTag * static_cast<float>(cut.far_sides) - kCutTag;
  return cut;
}

inline ScreenSplat ScreenDepth::record() const {
  return {middle, by[0],     -(has_cut ? kDepthOfCutTag : kDepthTag) - correlation,
          by[1],  per_depth, 0,
          0,      0,         0,
          0,      0,         0,
          0,      0,         0,
          0};
}
inline ScreenDepth ScreenDepth::of(const ScreenSplat& r) {
  ScreenDepth depth;
  depth.middle = r.x;
  depth.by = {r.y, r.l21};
  depth.per_depth = r.l22;
  depth.has_cut = hasTagFrom(r.l11, kDepthOfCutTag);
  depth.correlation = -r.l11 - (depth.has_cut ? kDepthOfCutTag : kDepthTag);
  return depth;
}

inline ScreenSplat ScreenColour::record() const {
  return {mean, slope[0], -kColourTag - correlation, slope[1], half_width, along, 0, 0, 0, 0, 0, 0, 0, 0,
          0,    0};
}
inline ScreenColour ScreenColour::of(const ScreenSplat& r) {
  return {r.x, {r.y, r.l21}, r.l22, -r.l11 - kColourTag, r.amplitude};
}

/// A splat's records, found beside it. `step` is -1 where splats come from the nearest to the farthest, else
/// 1.
struct SplatRecords {
  const ScreenSplat* cut = nullptr;
  const ScreenSplat* depth = nullptr;
  const ScreenSplat* colour = nullptr;

  /// `coloured`: the picture is of two scalars.
  static SplatRecords beside(const ScreenSplat* splat, int step, bool coloured) {
    SplatRecords records;
    const ScreenSplat* next = splat + step;
    if (coloured) {
      records.colour = next;
      next += step;
    }
    if (!hasCut(*splat)) return records;
    const bool placed = isDepth(*next);
    if (placed) records.depth = next;
    if (!placed)
      records.cut = next;
    else if (ScreenDepth::of(*next).has_cut)
      records.cut = next + step;
    return records;
  }
};

}  // namespace curvisplat
