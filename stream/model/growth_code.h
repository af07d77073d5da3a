// How the cells around a splat grow, and the skew that its kernel has from that: packed into 32 bits, and
// unpacked either whole, by cellGrowth(), or piece by piece in loops over many codes. All functions are
// pure: any thread may call them.
//
// Where cells grow by a factor e^g from one to the next along a lattice axis, a uniform medium is uniform
// only if kernels widen with the cells: each falls off slowly to the side of the large cells and steeply to
// that of the small ones. To first order a kernel K(u) becomes
//
//     K(u) max(0, 1 + Σ_a kSkewOfGrowth g_a He3(ê_a · u / σ) / 6)      He3(v) = v³ - 3 v
//
// with ê_a the unit vectors of the lattice axes in the frame of the splat's A (at right angles, since J = A
// Q) and σ = kKernelSigma: a Gram-Charlier series with the third moment that growth gives. Weight and middle
// are as without.
//
//   bits 0-5, 6-11, 12-17       g_a in steps of 1/32, -20 to 20, in two's complement
//        18-21, 22-25, 26-29    x, y, z of the quaternion that takes the frame's axes to ê_a, in steps of
//                               0.08, -7 to 7; w > 0 follows
//        30-31                  zero
//
// The order of the axes and their signs are chosen so that the rotation is small. No growth is zero.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stream/model/fits.h"

namespace curvisplat {

/// The code of a cell whose neighbours are about as long as itself.
inline constexpr uint32_t kNoGrowth = 0;

struct CellGrowth {
  std::array<glm::vec3, 3> axis;  // unit length, at right angles
  std::array<float, 3> growth{};  // g_a
};

/// `axis`: unit vectors at right angles, of either handedness; those of zero growth need not be set.
uint32_t packGrowthCode(std::array<glm::dvec3, 3> axis, std::array<double, 3> growth);
CellGrowth cellGrowth(uint32_t growth_code);

/// Whether packGrowthCode() can give this code.
bool isPossibleGrowthCode(uint32_t growth_code);

/// The unit vectors of cellGrowth(), at right angles.
using GrowthFrame = std::array<glm::vec3, 3>;

inline constexpr int kGrowthBits = 6, kGrowthFrameShift = 3 * kGrowthBits, kGrowthFrameBits = 12;
inline constexpr float kGrowthStep = 1.0f / 32;
inline constexpr int kLargestGrowthCode = 20;                      // in steps
inline constexpr int kRotationBits = 4, kLargestRotationCode = 7;  // in steps
inline constexpr double kRotationStep = 0.08;

/// The frames of all rotations that codes can have, by frameNumber().
std::span<const GrowthFrame> growthFrames();

inline uint32_t frameNumber(uint32_t growth_code) {
  return growth_code >> kGrowthFrameShift & ((1u << kGrowthFrameBits) - 1);
}

/// The growth of the code along axis `a`.
inline float growthOf(uint32_t growth_code, size_t a) {
  constexpr int kAbove = 32 - kGrowthBits;  // shifted out, and the sign shifted in
  const auto bits = static_cast<int>(kGrowthBits * a);
  return kGrowthStep * static_cast<float>(static_cast<int32_t>(growth_code << (kAbove - bits)) >> kAbove);
}

}  // namespace curvisplat
