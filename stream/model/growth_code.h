// How the cells around a splat grow, and the skew that its kernel has from that.
//
// Where cells grow by a factor e^g from one to the next along a lattice axis, a uniform medium is uniform only
// if kernels widen with the cells: each falls off slowly to the side of the large cells and steeply to that of
// the small ones. To first order a kernel K(u) becomes
//
//     K(u) max(0, 1 + Σ_a kSkewOfGrowth g_a He3(ê_a · u / σ) / 6)      He3(v) = v³ - 3 v
//
// with ê_a the unit vectors of the lattice axes in the frame of the splat's A (at right angles, since J = A Q)
// and σ = kKernelSigma: a Gram-Charlier series with the third moment that growth gives. Weight and middle are
// as without. In a uniform medium in one dimension, p98/p2 of the density:
//
//     growth e^g             1.1     1.25    1.5
//     symmetric kernel       1.027   1.062   1.116
//     skewed                 1.003   1.008   1.025
//
//   bits 0-4, 5-9, 10-14    g_a in steps of 1/16, -10 to 10, in two's complement
//        15-18, 19-22, 23-26    x, y, z of the quaternion that takes the frame's axes to ê_a, in steps of
//                               0.08, -7 to 7; w > 0 follows
//        27-31              zero
//
// The order of the axes and their signs are chosen so that the rotation is small. No growth is zero.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

namespace curvisplat {

/// Of a cell whose neighbours are about as long as itself.
inline constexpr uint32_t kNoGrowth = 0;

/// A kernel's third cumulant along an axis, over σ³, for g = 1. Least squares for growths from 1.1 to 1.5.
inline constexpr float kSkewOfGrowth = 0.9f;

struct CellGrowth {
  std::array<glm::vec3, 3> axis;  // unit length, at right angles
  std::array<float, 3> growth{};  // g_a
};

/// `axis`: unit vectors at right angles, of either handedness; those of zero growth need not be set.
uint32_t packGrowthCode(std::array<glm::dvec3, 3> axis, std::array<double, 3> growth);
CellGrowth cellGrowth(uint32_t growth_code);

/// False for what packGrowthCode() never gives.
bool isPossibleGrowthCode(uint32_t growth_code);

}  // namespace curvisplat
