// What the geometry's encoder and decoder must agree on: ranges, and the steps in which numbers are stored.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "stream/codec/geometry_codec.h"
#include "stream/codec/log_table.h"

namespace curvisplat {

inline constexpr int kMinPositionBits = 5;  // merging's lattice of 32 voxels an axis
inline constexpr int kMaxPositionBits = 32;

// Half a step is what a number can be off. With E = A⁻¹ A' - I lower triangular, |E00|, |E11| <= 0.0071,
// |E22| <= 0.0149 (it makes up for both, and for half a volume step) and each shear's entry <= 0.0138, the
// Frobenius norm of (I + E)(I + E)ᵀ - I, which bounds the spectral norm, is below 0.05.
inline constexpr double kAxisStep = 0.014;
inline constexpr double kShearStep = 0.027;
inline constexpr double kVolumeStep = 0.0016;
// Weights of nodes agree with the decoded volume within half a volume step and are then coded as 0.
inline constexpr double kWeightStep = 0.0019;

inline constexpr uint32_t kLargestLogCode = 0xffff;
inline constexpr int kLargestWeightCode = 100000;  // a ratio of e^±190

// Codes of weights: 0 is V = a0 a1 a2, 1 is V = 0, others are zigzag(steps) + 1.
inline constexpr uint32_t kVolumeWeight = 0, kZeroWeight = 1;

inline constexpr size_t kMaxRunBytes = 50;  // five varints

/// The steps of the shears of splat n, which depend on its decoded axes and, for l10, on its decoded l21: an
/// error of l10 moves the third axis l21 times as far. Powers of two, so that neighbours mostly share them
/// and their codes can be predicted.
struct ShearSteps {
  static double l21(const DecodedGeometry& d, size_t n) {
    return powerOfTwo(kShearStep * d.axis[2][n] / d.axis[1][n]);
  }
  static double l10(const DecodedGeometry& d, size_t n) {
    const double lever = std::abs(d.shear[2][n]) * d.axis[1][n] / d.axis[2][n];
    return powerOfTwo(kShearStep * d.axis[1][n] / (d.axis[0][n] * std::max(1.0, lever)));
  }
  static double l20(const DecodedGeometry& d, size_t n) {
    return powerOfTwo(kShearStep * d.axis[2][n] / d.axis[0][n]);
  }

 private:
  /// The largest that is not above `step` > 0: the exponent without the mantissa.
  static double powerOfTwo(double step) {
    return std::bit_cast<double>(std::bit_cast<uint64_t>(step) & 0x7ff0000000000000);
  }
};

/// e^(n kWeightStep) at n + kLargestWeightCode.
inline const LogTable& ratioTable() {
  static const LogTable table(-kWeightStep * kLargestWeightCode, kWeightStep, 2 * kLargestWeightCode);
  return table;
}

}  // namespace curvisplat
