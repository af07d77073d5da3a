// The geometry stream of a brick: node runs, positions, shapes, weights, border codes and growth codes. Its
// layout and the quantisation steps are here; geometry_encoder.cpp writes it and geometry_decoder.cpp reads
// it. All functions are pure, with scratch memory of each thread: any thread may call them.
//
//   GeometryHeader | zstd frame: node runs (varints)
//                              | planes of x, y, z
//                              | planes of ln a0, ln a1, ln volume, l21, l10, l20
//                              | planes of the weights
//                              | planes of the border codes
//                              | planes of the growth codes
//
//   positions      the highest `position_bits` bits of the lattice position in the cell; decoded as the
//                  middle of their interval
//   shapes         ln a0, ln a1 and ln(a0 a1 a2) in fixed steps. a2 is derived from them, so that the volume
//                  is accurate to 0.1 % whatever the errors of the axes. Then the shears l21, l10, l20, in
//                  steps that shrink with the splat's aspect ratio, because the error that counts is that of
//                  A⁻¹ A', not that of A'. l20 compensates the rounding error of l10.
//   weights        ln(V / (a0 a1 a2)) in fixed steps. Code 0 is V = a0 a1 a2, as for a node's splat; code 1
//                  is V = 0.
//   border codes   the four bytes of the code (stream/model/border_code.h), lowest first; absent (no
//                  kHasBorders) if the brick has none
//   growth codes   bits 0-17 of the code (stream/model/growth_code.h), then its other bits; absent (no
//                  kHasGrowth) if the brick has none
//
// Shapes or weights that do not fit these codes are stored as raw 64-bit floats (kRawShapes, kRawWeights).
// stream/FORMAT.md has every formula.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/log_codes.h"
#include "stream/codec/planes.h"
#include "stream/codec/prediction.h"
#include "stream/model/splats.h"

namespace curvisplat {

inline constexpr uint8_t kRawShapes = 1, kRawWeights = 2, kHasBorders = 4, kHasGrowth = 8;
inline constexpr int kGrowthBitsOfFirstArray = 18;
inline constexpr size_t kLargestGeometryArrays = 3 + 12 + 2 + 4 + 2;

struct GeometryHeader {
  uint8_t position_bits;                    //  0: 5..32
  uint8_t raw;                              //  1: kRawShapes, kRawWeights, kHasBorders, kHasGrowth
  uint16_t reserved;                        //  2: zero
  uint32_t runs_bytes;                      //  4: length of the varints, unpacked
  double log_axis0, log_axis1, log_volume;  //  8: natural logarithms of the brick's smallest a0, a1, volume
  // 32: in the order of the planes: x, y, z, ln a0, ln a1, ln volume, l21, l10, l20, weight, border codes,
  // growth codes
  std::array<ArrayCode, kLargestGeometryArrays> arrays;
  uint8_t more_reserved[2];  // 78: zero
};                           // 80
static_assert(sizeof(GeometryHeader) == 80);

/// A brick's geometry without shapes and weights, decoded. Reusable scratch memory.
struct DecodedPlaces {
  int position_bits = 0;
  std::array<std::vector<uint32_t>, 3> position;  // in units of cell size / 2^position_bits
  std::vector<uint32_t> border_code, growth_code;
  std::vector<NodeRun> runs;
  std::vector<Row> rows;
};

/// Arrays of shapes and weights to decode into; borrowed. Floats are the doubles, rounded; an axis too small
/// for a float becomes the smallest normal one: smaller divisors would overflow.
template <typename Number>
struct ShapeArrays {
  std::array<Number*, 3> axis, shear;
  Number* weight;
};

/// A brick's geometry, decoded in double. Reusable scratch memory.
struct DecodedGeometry : DecodedPlaces {
  std::array<std::vector<double>, 3> axis, shear;
  std::vector<double> weight;

  void resize(size_t count);
};

/// Encodes the splats of a brick, and fills `decoded` as decodeGeometryStream() will. Throws nothing but
/// bad_alloc.
std::vector<std::byte> encodeGeometryStream(const RootCube& root, const BrickSplats& brick,
                                            DecodedGeometry& decoded);

/// Decodes untrusted bytes: throws Error unless they hold exactly `count` finite splats in `cell`. For
/// merging.
void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedGeometry& out);
/// The same, straight to floats. For drawing.
void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedPlaces& places, const ShapeArrays<float>& shapes);

/// The lattice position that `code`, the highest `position_bits` bits in the cell, stands for: the
/// interval's middle.
uint64_t latticePosition(uint32_t code, int position_bits, uint32_t level, uint32_t cell_at);

// The ranges of codes and the quantisation steps, which the encoder and the decoder share.

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

/// Quantisation steps of the shears of splat n. They depend on the splat's decoded axes. The step of l10
/// also depends on the decoded l21, because an error of l10 moves the third axis by l21 times as much. Steps
/// are powers of two, so that neighbouring splats mostly share them and their codes can be predicted.
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
