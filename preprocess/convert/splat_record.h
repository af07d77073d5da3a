// A splat as conversion keeps it in temporary files and in a bucket's memory: 51 + 16 v bytes for v
// variables, not aligned, in the machine's own byte order.
//
//    0   node number: 47 bits, and bit 47 says "irregular"     48 bits
//    6   position: x, y, z                                     3 x 48 bits
//   24   a0 a1 a2: floats > 0 without sign and last 7 bits     3 x 24 bits
//   33   l10 l20 l21                                           3 x float
//   45   weight / (a0 a1 a2), in steps of 2^-15                16 bits
//   47   growth code                                           32 bits
//   51   mean w0 w1 w2                                         4 x float a variable
//        irregular: weight / (a0 a1 a2), in place of the above 1 x float
//                   border code                                32 bits
//                   variance                                   1 x float a variable
//
// What is not stored of a regular splat (nearly all are) is known: its variances are 0 and its cell is whole.
// Records of one bucket follow one another; their lengths are
// known from their flag. Axes are good to 8e-6; shears need all of float's digits, since a thin cell
// multiplies them by its aspect ratio. Weights are good to 1e-4, where the cache
// keeps 1e-3; one of a0 a1 a2 is kept as that.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "preprocess/splats/node_splats.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Largest number of nodes of a grid.
inline constexpr uint64_t kMaxNodes = uint64_t{1} << 47;

inline constexpr size_t regularRecordBytes(size_t variables) {
  return 51 + 16 * variables;
}
inline constexpr size_t irregularRecordBytes(size_t variables) {
  return regularRecordBytes(variables) + 8 + 4 * variables;
}

/// A number as records keep it: beyond float's range it becomes the largest.
inline float recordFloat(double value) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

/// Appends the record of a splat. Numbers beyond float's range become its largest.
void packRecord(const NodeSplat& splat, std::span<const SplatScalar> values, const RootPosition& position,
                std::vector<std::byte>& out);

/// A word of 48 bits, by one load: two bytes more of the record follow each. (Two short loads would be put together in memory,
/// and the load of the whole would wait for them.)
inline uint64_t recordWord48(const std::byte* at) {
  uint64_t word;
  std::memcpy(&word, at, sizeof word);
  return word & ((uint64_t{1} << 48) - 1);
}
inline bool recordIsIrregular(const std::byte* record) {
  return (recordWord48(record) >> 47) != 0;
}
inline uint64_t recordNode(const std::byte* record) {
  return recordWord48(record) & (kMaxNodes - 1);
}
inline RootPosition recordPosition(const std::byte* record) {
  return {{recordWord48(record + 6), recordWord48(record + 12), recordWord48(record + 18)}};
}
inline size_t recordBytes(const std::byte* record, size_t variables) {
  return recordIsIrregular(record) ? irregularRecordBytes(variables) : regularRecordBytes(variables);
}

/// Reads a record's splat (but for its position) and its values, one a variable.
SplatCodes unpackRecord(const std::byte* record, Splat& splat, std::span<SplatScalar> values);

}  // namespace curvisplat
