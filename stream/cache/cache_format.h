// The records of bricks.bin and var.<n>.bin, exactly as they are on disk: little-endian, naturally aligned,
// no padding. stream/FORMAT.md describes the whole format.
//
//   bricks.bin     BricksHeader | BrickRecord x bricks, level by level from the root, Morton order in a level
//
//   var.<n>.bin    VariableHeader | values streams | zeros | VariableRecord x bricks, in bricks.bin's order
//                  ^ offset 0                              ^ table_offset, a multiple of kPageBytes
//                  The last of the zeros may be a HistogramRecord (value_histogram.h).
//
//   geometry.bin   geometry streams | zeros to a multiple of kPageBytes; bricks.bin has the streams' extents
//
// A stream begins where the previous one ends if it then touches no more pages than its length needs, else at
// the next page. So small streams share a page, no stream crosses a page boundary without need, and a direct
// read fetches the fewest pages. Gaps are filled with zeros.
//
// The layouts of the streams are in stream/codec/geometry_codec.h and stream/codec/values_codec.h.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>

#include "stream/model/octree.h"

namespace curvisplat {

static_assert(std::endian::native == std::endian::little, "records are written as they are in memory");

/// Version of the tables, the same in both versions of the format. What version 2 adds is named in the manifest
/// (manifest.h). A change to the meaning of anything adds a feature there; the program must continue to read
/// caches without it: tests/data/caches has caches of each kind, and a new feature adds its own there.
inline constexpr uint32_t kTableVersion = 1;
inline constexpr uint64_t kPageBytes = 4096;
inline constexpr std::array<char, 8> kBricksMagic{'C', 'V', 'S', 'b', 'r', 'i', 'c', 'k'};
inline constexpr std::array<char, 8> kVariableMagic{'C', 'V', 'S', 'v', 'a', 'l', 'u', 'e'};

struct BricksHeader {
  std::array<char, 8> magic = kBricksMagic;  // 0
  uint32_t version = kTableVersion;          // 8
  uint32_t record_bytes = 0;                 // 12
  uint64_t bricks = 0;                       // 16
};                                           // 24
static_assert(sizeof(BricksHeader) == 24 && std::is_trivially_copyable_v<BricksHeader>);

struct BrickRecord {
  uint32_t level;              //   0
  uint32_t at[3];              //   4
  uint32_t splats;             //  16
  uint32_t octant_splats[8];   //  20
  float largest_radius;        //  52
  float error;                 //  56
  uint32_t parent;             //  60
  double lower[3];             //  64
  double upper[3];             //  88
  uint32_t first_child;        // 112
  uint32_t child_count;        // 116
  uint64_t geometry_offset;    // 120
  uint64_t geometry_checksum;  // 128
  uint32_t geometry_length;    // 136
  uint32_t reserved;           // 140: zero
};                             // 144
static_assert(sizeof(BrickRecord) == 144 && std::is_trivially_copyable_v<BrickRecord>);
static_assert(offsetof(BrickRecord, lower) == 64 && offsetof(BrickRecord, geometry_offset) == 120);

struct VariableHeader {
  std::array<char, 8> magic = kVariableMagic;  // 0
  uint32_t version = kTableVersion;            // 8
  uint32_t record_bytes = 0;                   // 12
  uint64_t bricks = 0;                         // 16
  uint64_t table_offset = 0;                   // 24
};                                             // 32
static_assert(sizeof(VariableHeader) == 32 && std::is_trivially_copyable_v<VariableHeader>);

struct VariableRecord {
  uint64_t offset;          //  0
  uint64_t checksum;        //  8
  uint32_t length;          // 16
  float min, max;           // 20
  float largest_slope;      // 28
  float largest_deviation;  // 32
  uint32_t reserved;        // 36: zero
};                          // 40
static_assert(sizeof(VariableRecord) == 40 && std::is_trivially_copyable_v<VariableRecord>);

inline BrickRecord recordOf(const Brick& brick) {
  BrickRecord record{};
  record.level = brick.cell.level;
  record.splats = brick.splats;
  record.largest_radius = brick.largest_radius;
  record.error = brick.error;
  record.parent = brick.parent;
  record.first_child = brick.first_child;
  record.child_count = brick.child_count;
  record.geometry_offset = brick.geometry.offset;
  record.geometry_checksum = brick.geometry.checksum;
  record.geometry_length = brick.geometry.length;
  for (int axis = 0; axis < 3; ++axis) {
    record.at[axis] = brick.cell.at[axis];
    record.lower[axis] = brick.lower[axis];
    record.upper[axis] = brick.upper[axis];
  }
  for (int octant = 0; octant < 8; ++octant) record.octant_splats[octant] = brick.octant_splats[octant];
  return record;
}

inline Brick brickOf(const BrickRecord& record) {
  Brick brick;
  brick.cell.level = record.level;
  brick.splats = record.splats;
  brick.largest_radius = record.largest_radius;
  brick.error = record.error;
  brick.parent = record.parent;
  brick.first_child = record.first_child;
  brick.child_count = record.child_count;
  brick.geometry = {record.geometry_offset, record.geometry_length, record.geometry_checksum};
  for (int axis = 0; axis < 3; ++axis) {
    brick.cell.at[axis] = record.at[axis];
    brick.lower[axis] = record.lower[axis];
    brick.upper[axis] = record.upper[axis];
  }
  for (int octant = 0; octant < 8; ++octant) brick.octant_splats[octant] = record.octant_splats[octant];
  return brick;
}

inline VariableRecord recordOf(const BrickVariable& variable) {
  return {variable.values.offset, variable.values.checksum, variable.values.length,     variable.min,
          variable.max,           variable.largest_slope,   variable.largest_deviation, 0};
}

inline BrickVariable brickVariableOf(const VariableRecord& record) {
  return {{record.offset, record.length, record.checksum},
          record.min,
          record.max,
          record.largest_slope,
          record.largest_deviation};
}

/// The offset of a stream of `length` bytes that is appended to a file of `end` bytes.
inline uint64_t streamOffset(uint64_t end, uint64_t length) {
  const uint64_t in_page = end % kPageBytes;
  const uint64_t pages = (length + kPageBytes - 1) / kPageBytes;
  return in_page + length <= pages * kPageBytes ? end : end - in_page + kPageBytes;
}

}  // namespace curvisplat
