// The geometry stream of a brick: node runs, positions, shapes, weights.
//
//   GeometryHeader | zstd frame: runs (varints) | planes of x, y, z | planes of the shapes | planes of
//   weights | planes of half cells
//
//   positions  the highest `position_bits` bits of the lattice position in the cell, decoded as the middle of
//              their interval
//   shapes     ln a0, ln a1 and ln(a0 a1 a2) in fixed steps; a2 follows, so that the volume is kept to 0.1 %
//              whatever the axes lose. Then the shears l21, l10, l20, each in steps that shrink with the
//              splat's own aspect ratio: what must be exact is A⁻¹ A', not A'. l20 makes up for what l10
//              lost.
//   weights    ln(V / (a0 a1 a2)) in fixed steps: 0 for a node's splat, 1 for V = 0
//   half cells the four bytes of border_code.h's code, lowest first; only where a brick has any (kHasBorders)
//
// Shapes or weights whose numbers do not fit are stored as raw 64-bit floats instead (kRawShapes,
// kRawWeights).
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

inline constexpr uint8_t kRawShapes = 1, kRawWeights = 2, kHasBorders = 4;
inline constexpr size_t kLargestGeometryArrays = 3 + 12 + 2 + 4;

struct GeometryHeader {
  uint8_t position_bits;                    //  0: 5..32
  uint8_t raw;                              //  1: kRawShapes, kRawWeights, kHasBorders
  uint16_t reserved;                        //  2: zero
  uint32_t runs_bytes;                      //  4: of the varints, unpacked
  double log_axis0, log_axis1, log_volume;  //  8: of the smallest, natural
  std::array<ArrayCode, kLargestGeometryArrays>
      arrays;                // 32: x y z, ln a0, ln a1, ln volume, l21 l10 l20, weight, half cells
  uint8_t more_reserved[6];  // 74: zero
};                           // 80
static_assert(sizeof(GeometryHeader) == 80);

/// A brick's geometry, decoded in double; scratch that is used again.
struct DecodedGeometry {
  int position_bits = 0;
  std::array<std::vector<uint32_t>, 3> position;  // in units of cell size / 2^position_bits
  std::array<std::vector<double>, 3> axis, shear;
  std::vector<double> weight;
  std::vector<uint32_t> border_code;
  std::vector<NodeRun> runs;
  std::vector<Row> rows;

  void resize(size_t count);
};

/// Encodes, and fills `decoded` with what decodeGeometryStream will give. Throws nothing but bad_alloc.
std::vector<std::byte> encodeGeometryStream(const RootCube& root, const BrickSplats& brick,
                                            DecodedGeometry& decoded);

/// Bytes are untrusted: throws Error for anything but `count` finite splats in `cell`.
void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedGeometry& out);

/// The lattice position that position_bits bits of it stand for.
uint64_t latticePosition(uint32_t code, int position_bits, uint32_t level, uint32_t cell_at);

}  // namespace curvisplat
