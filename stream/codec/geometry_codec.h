// The geometry stream of a brick: node runs, positions, shapes, weights, border codes and growth codes.
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
//                  is accurate to 0.1 % whatever the errors of the axes. Then the shears l21, l10 and l20, in
//                  steps that shrink with the splat's aspect ratio, because the error that counts is that of
//                  A⁻¹ A', not that of A'. l20 compensates the rounding error of l10.
//   weights        ln(V / (a0 a1 a2)) in fixed steps. Code 0 is V = a0 a1 a2, as for a node's splat; code 1
//                  is V = 0.
//   border codes   the four bytes of the code (stream/model/border_code.h), lowest first; absent (no
//                  kHasBorders) if the brick has none
//   growth codes   bits 0-17 of the code (stream/model/growth_code.h), then its other bits; absent (no kHasGrowth)
//                  if the brick has none
//
// Shapes or weights that do not fit these codes are stored as raw 64-bit floats (kRawShapes, kRawWeights).
// stream/FORMAT.md has every formula.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/planes.h"
#include "stream/codec/prediction.h"
#include "stream/model/brick_splats.h"

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
  // 32: in the order of the planes: x, y, z, ln a0, ln a1, ln volume, l21, l10, l20, weight, border codes, growth codes
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

/// Arrays of shapes and weights to decode into; borrowed. Floats are the doubles, rounded; an axis too small for a float
/// becomes the smallest normal one: smaller divisors would overflow.
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

/// Encodes `brick` and fills `decoded` as decodeGeometryStream() will. Throws nothing but bad_alloc.
std::vector<std::byte> encodeGeometryStream(const RootCube& root, const BrickSplats& brick,
                                            DecodedGeometry& decoded);

/// Decodes untrusted bytes: throws Error unless they hold exactly `count` finite splats in `cell`. For merging.
void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedGeometry& out);
/// The same, straight to floats. For drawing.
void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedPlaces& places, const ShapeArrays<float>& shapes);

/// The lattice position that `code`, the highest `position_bits` bits in the cell, stands for: the interval's
/// middle.
uint64_t latticePosition(uint32_t code, int position_bits, uint32_t level, uint32_t cell_at);

}  // namespace curvisplat
