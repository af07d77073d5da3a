// The records of bricks.bin and var.<number>.bin as they are on disk: little-endian, naturally aligned, no
// padding.
//
//   bricks.bin        BricksHeader | BrickRecord x bricks, level by level, Morton order, root first
//
//   var.<n>.bin       VariableHeader | values streams, page by page | VariableRecord x bricks, in the order
//                     ^ offset 0       of bricks.bin                 ^ table_offset, a multiple of kPageBytes
//
//   geometry.bin      geometry streams, page by page: nothing else (bricks.bin says where each lies)
//
// A stream starts at the end of the one before it if it then touches no more pages than it has to, else at
// the next page. So small neighbours share a page, none is split without need, and a direct read fetches the
// fewest pages. The gaps are zeros.
//
// The streams themselves are laid out in geometry_codec.h and values_codec.h.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>

#include "stream/model/brick.h"

namespace curvisplat {

static_assert(std::endian::native == std::endian::little, "records are written as they lie in memory");

/// Of the tables: both versions of the format have these. What is new in version 2 is named in the manifest
/// (manifest.h). Whoever changes what anything means adds a feature there, still reads the caches without it
/// (tests/data/caches has some of each), and makes caches with it there.
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

/// Where a stream of `length` bytes goes in a file that ends at `end`.
inline uint64_t streamOffset(uint64_t end, uint64_t length) {
  const uint64_t in_page = end % kPageBytes;
  const uint64_t pages = (length + kPageBytes - 1) / kPageBytes;
  return in_page + length <= pages * kPageBytes ? end : end - in_page + kPageBytes;
}

}  // namespace curvisplat
