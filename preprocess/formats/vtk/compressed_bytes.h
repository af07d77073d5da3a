// Bytes in compressed blocks, as VTK's XML files have them:
//
//   table   | blocks | bytes a block | bytes of the last, 0: as the others | compressed bytes of block 0 | 1
//   | ... blocks  | block 0 | block 1 | ...         each for itself: a zlib stream or an LZ4 block
//
// All of the table are integers of one size and byte order. Of it, one position in a thousand blocks is kept;
// the rest is read again where it is needed.
#pragma once

#include <vector>

#include "preprocess/formats/common/byte_order.h"
#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/spool_file.h"

namespace curvisplat {

enum class BlockCompressor { kZlib, kLz4 };

/// Integers as the heads of a file's arrays have them.
struct HeaderIntegers {
  size_t bytes = 4;  // 4 or 8
  ByteOrder order = ByteOrder::kLittle;

  uint64_t at(std::span<const std::byte> stored) const;
  uint64_t at(const ByteSource& source, uint64_t offset) const;
};

/// Blocks of more bytes are no longer unpacked in memory.
inline constexpr uint64_t kLargestBlockInMemory = uint64_t{8} << 20;

class CompressedBytes final : public ByteSource {
 public:
  struct Parts {
    std::shared_ptr<const ByteSource> table, blocks;
    HeaderIntegers integers;
    BlockCompressor compressor = BlockCompressor::kZlib;
    std::string place;  // for errors: "FILE: array NAME"
  };

  /// Reads the table. Throws Error unless it tells of exactly `size` bytes, in blocks that are there and that
  /// can hold as many, of at most kLargestBlockInMemory.
  CompressedBytes(Parts parts, uint64_t size);

  uint64_t size() const override { return size_; }
  /// Unpacks the blocks that `to` lies in, and keeps the last one for this thread's next call.
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

 private:
  struct Place {
    uint64_t offset = 0, bytes = 0;  // in parts_.blocks
  };
  Place placeOf(uint64_t block) const;
  uint64_t bytesOf(uint64_t block) const;
  std::span<const std::byte> unpacked(uint64_t block) const;

  const uint64_t id_;  // never used twice: what a thread has kept is known by it
  Parts parts_;
  uint64_t size_ = 0, blocks_ = 0, block_bytes_ = 0;
  std::vector<uint64_t> offsets_;  // of each kTableStride-th block
};

/// The bytes of `parts`, which should be `size`: a CompressedBytes, or, if zlib blocks are larger than
/// kLargestBlockInMemory, all of them unpacked into `spool` when the first are read. Throws Error as
/// CompressedBytes does; LZ4 blocks of that size are refused.
std::shared_ptr<const ByteSource> compressedBytes(CompressedBytes::Parts parts, uint64_t size,
                                                  const std::shared_ptr<SpoolFile>& spool);

}  // namespace curvisplat
