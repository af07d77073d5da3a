// The tags by which records among splats are told from splats and from one another (screen_splat.h), for C++, vector code and
// shaders. Where a splat has l11, which is positive, a record has -(tag + correlation), of a correlation from -1 to 1. A
// ScreenCut's tag is kCutTag + kFarSidesTag far_sides: below 32.
#pragma once

namespace curvisplat {

inline constexpr float kCutTag = 2, kFarSidesTag = 4;
inline constexpr float kDepthTag = 34,
                       kDepthOfCutTag = 98;  // of a ScreenDepth alone, and with a ScreenCut beyond it
inline constexpr float kColourTag = 194;

/// Whether an element's l11 is that of a record with this tag or a larger one.
constexpr bool hasTagFrom(float l11, float tag) {
  return l11 < 2 - tag;
}

}  // namespace curvisplat
