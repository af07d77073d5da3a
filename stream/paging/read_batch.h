// Chooses the reads that fetch the next bricks: a pure function of where their streams lie.
//
// Bricks are drawn in an order that turns with the camera and lie in the file in one that does not, but both
// walk the same octree: what is drawn within a short time lies close together. So the bricks of one batch are
// read file by file in the file's order, and extents that touch, share a page or nearly touch become one
// read.
//
//   drawn    7 6 5 4 3 2 1 0            geometry.bin   |0 |1 |2|3 |  |4 |5|6 |7 |
//                                       reads           ------------  ----------
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/model/octree.h"

namespace curvisplat {

inline constexpr size_t kBrickStreams = 3;  // geometry, then the values of one variable or two
/// The extents of one brick's streams, each in a file of its own. One of length 0 is not read.
using BrickExtents = std::array<Extent, kBrickStreams>;

/// Reading a gap of this many bytes takes less time than one more request.
inline constexpr uint64_t kMaxGapBytes = 32 << 10;
/// Larger reads are no faster, and come later.
inline constexpr uint64_t kMaxJoinedBytes = 1 << 20;
inline constexpr size_t kMaxBatchBricks = 256;

/// One read of a batch.
struct BatchRead {
  uint8_t stream = 0;   // which file
  uint64_t offset = 0;  // a multiple of kPageBytes
  uint32_t length = 0;  // a multiple of kPageBytes; the file may end before it
  uint32_t needed = 0;  // bytes up to the last stream's end
  uint32_t place = 0;   // where the read goes in the batch's buffer, a multiple of kPageBytes
  uint32_t first = 0;   // the first brick in the batch that waits for it
};

/// The places of one brick's streams in a batch.
struct BatchBrick {
  static constexpr uint32_t kNoRead = 0xffffffff;

  std::array<uint32_t, kBrickStreams> place;  // of the streams in the batch's buffer
  std::array<uint32_t, kBrickStreams> read;   // that brings them
};

/// The reads that fetch the next bricks.
struct ReadBatch {
  std::vector<BatchRead> reads;    // in the order in which their bricks come
  std::vector<BatchBrick> bricks;  // the first of those asked for
  uint32_t bytes = 0;              // of the buffer
};

/// Pages that a brick takes when it is read alone, in bytes.
uint64_t pagedBytes(const BrickExtents& brick);

/// Plans the reads of as many of the first `bricks` as `limit_bytes` hold: one at least. With the gaps the
/// batch may have twice that; of a brick alone it has pagedBytes().
ReadBatch planBatch(std::span<const BrickExtents> bricks, uint64_t limit_bytes);

}  // namespace curvisplat
