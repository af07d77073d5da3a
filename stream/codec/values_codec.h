// The values stream of a brick: one scalar of its splats.
//
//   ValuesHeader | zstd frame: rows (varints) | planes of mean, slope0, slope1, slope2, deviation
//
//   means      16 bits over the brick's own range
//   slopes     steps of 2^-13 of the brick's span (the range of its means, or its largest slope or deviation
//              where that is more): at the rim of a footprint, 1.556 |w| away, the scalar is off by at most
//              1.7e-4 of the span
//   deviation  √r in steps of 2^-12 of the span; 0 stays 0
//
// The stream carries the rows itself, where they serve its prediction, so that it decodes without geometry.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/planes.h"
#include "stream/codec/prediction.h"
#include "stream/model/splats.h"

namespace curvisplat {

struct ValuesHeader {
  float lower, upper;                 //  0: of the means
  double slope_step, deviation_step;  //  8: the scalar's unit
  uint32_t rows_bytes;                // 24: of the varints, unpacked
  std::array<ArrayCode, 5> arrays;    // 28: mean, three slopes, deviation
  uint8_t reserved[2];                // 38: zero
};                                    // 40
static_assert(sizeof(ValuesHeader) == 40);

/// Encodes `values` and replaces them by what decodeValuesStream will give. `rows` as the geometry's.
std::vector<std::byte> encodeValuesStream(std::span<const Row> rows, std::span<SplatScalar> values);

/// Bytes are untrusted: throws Error for anything but `count` finite values. `out`: [count].
void decodeValuesStream(uint32_t count, std::span<const std::byte> bytes, const VariableArrays<float>& out);

}  // namespace curvisplat
