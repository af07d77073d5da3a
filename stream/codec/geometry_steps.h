// Constants that the geometry's encoder and decoder share: the ranges of codes, and the quantisation steps.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "stream/codec/geometry_codec.h"
#include "stream/codec/log_table.h"

namespace curvisplat {

inline constexpr int kMinPositionBits = 5;  // merging uses a lattice of 32 voxels per axis
inline constexpr int kMaxPositionBits = 32;

// The rounding error of a number is half a step. Let E = A⁻¹ A' - I, which is lower triangular. Then |E00|
// and |E11| are at most 0.0071, |E22| at most 0.0149 (it compensates both, and adds half a volume step), and
// the entries of the shears at most 0.0138. So the Frobenius norm of (I + E)(I + E)ᵀ - I, which bounds its
// spectral norm, is below 0.05.
inline constexpr double kAxisStep = 0.014;
inline constexpr double kShearStep = 0.027;
inline constexpr double kVolumeStep = 0.0016;
// Larger than the volume's step, so that a node's weight rounds to the decoded volume, which is code 0.
inline constexpr double kWeightStep = 0.0019;

inline constexpr uint32_t kLargestLogCode = 0xffff;
inline constexpr int kLargestWeightCode = 100000;  // a ratio of e^±190

// Codes of weights: 0 for V = a0 a1 a2, 1 for V = 0, and zigzag(steps) + 1 for all others.
inline constexpr uint32_t kVolumeWeight = 0, kZeroWeight = 1;

inline constexpr size_t kMaxRunBytes = 50;  // five varints

/// Quantisation steps of the shears of splat n. They depend on the splat's decoded axes. The step of l10 also
/// depends on the decoded l21, because an error of l10 moves the third axis by l21 times as much. Steps are
/// powers of two, so that neighbouring splats mostly share them and their codes can be predicted.
struct ShearSteps {
  static double l21(double a1, double a2) { return powerOfTwo(kShearStep * a2 / a1); }
  static double l10(double a0, double a1, double a2, double l21) {
    const double lever = std::abs(l21) * a1 / a2;
    return powerOfTwo(kShearStep * a1 / (a0 * std::max(1.0, lever)));
  }
  static double l20(double a0, double a2) { return powerOfTwo(kShearStep * a2 / a0); }

 private:
  /// The largest power of two that is not above `step` (> 0): the mantissa is cleared.
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
