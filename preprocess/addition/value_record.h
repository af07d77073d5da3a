// A splat's new values on their way into a cache that has its geometry: 14 + 16 v bytes for v variables, not
// aligned, in the machine's own byte order.
//
//    0   node number: 47 bits, and bit 47 says "with variances"     48 bits
//    6   place of the leaf brick, in the order of conversion         32 bits
//   10   where in the brick's cell: 10 bits an axis, x lowest        32 bits
//   14   mean w0 w1 w2                                               4 x float a variable
//        with variances: variance                                    1 x float a variable
//
// Nodes begin as in splat_record.h, so that sortByNode() serves both. Values are rounded as they are there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "preprocess/convert/splat_record.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

inline constexpr int kPlaceBits = 10;

inline constexpr size_t minValueRecordBytes(size_t variables) {
  return 14 + 16 * variables;
}
inline constexpr size_t maxValueRecordBytes(size_t variables) {
  return minValueRecordBytes(variables) + 4 * variables;
}

/// Where `position` is in `cell`, which holds it: the highest kPlaceBits bits of each axis. The cell's level
/// is at most kMaxLevel.
inline std::array<uint32_t, 3> placeInCell(const RootPosition& position, const Cell& cell) {
  std::array<uint32_t, 3> place;
  for (int axis = 0; axis < 3; ++axis)
    place[axis] = static_cast<uint32_t>(position.at[axis] >> (kPositionBits - kPlaceBits - cell.level)) &
                  ((1u << kPlaceBits) - 1);
  return place;
}

/// Appends a record.
void packValueRecord(uint64_t node, uint32_t brick, const std::array<uint32_t, 3>& place,
                     std::span<const SplatScalar> values, std::vector<std::byte>& out);

inline uint32_t valueRecordBrick(const std::byte* record) {
  uint32_t brick = 0;
  std::memcpy(&brick, record + 6, sizeof brick);
  return brick;
}
inline std::array<uint32_t, 3> valueRecordPlace(const std::byte* record) {
  uint32_t bits = 0;
  std::memcpy(&bits, record + 10, sizeof bits);
  constexpr uint32_t kMask = (1u << kPlaceBits) - 1;
  return {bits & kMask, bits >> kPlaceBits & kMask, bits >> (2 * kPlaceBits) & kMask};
}
inline size_t valueRecordBytes(const std::byte* record, size_t variables) {
  return recordIsIrregular(record) ? maxValueRecordBytes(variables) : minValueRecordBytes(variables);
}

/// Reads a record's values, one a variable.
void unpackValueRecord(const std::byte* record, std::span<SplatScalar> values);

}  // namespace curvisplat
