// What cellGrowth() puts together, for loops over many codes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

namespace curvisplat {

/// Unit vectors at right angles.
using GrowthFrame = std::array<glm::vec3, 3>;

inline constexpr int kGrowthBits = 6, kGrowthFrameShift = 3 * kGrowthBits, kGrowthFrameBits = 12;
inline constexpr float kGrowthStep = 1.0f / 32;
inline constexpr int kLargestGrowthCode = 20;                      // in steps
inline constexpr int kRotationBits = 4, kLargestRotationCode = 7;  // in steps
inline constexpr double kRotationStep = 0.08;

/// Those of every rotation that codes have, by frameNumber().
std::span<const GrowthFrame> growthFrames();

inline uint32_t frameNumber(uint32_t growth_code) {
  return growth_code >> kGrowthFrameShift & ((1u << kGrowthFrameBits) - 1);
}

/// Along axis `a`.
inline float growthOf(uint32_t growth_code, size_t a) {
  constexpr int kAbove = 32 - kGrowthBits;  // shifted out, and the sign shifted in
  const auto bits = static_cast<int>(kGrowthBits * a);
  return kGrowthStep * static_cast<float>(static_cast<int32_t>(growth_code << (kAbove - bits)) >> kAbove);
}

}  // namespace curvisplat
