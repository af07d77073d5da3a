// Byte sources for the ways in which VTK's XML files store arrays: base64, and compressed blocks, raw or in
// base64.
//
// Both read any range without what precedes it. In base64 each group of four characters encodes three bytes,
// so that every byte has a known position. Compressed blocks have a table of their sizes; reading
// decompresses the blocks that overlap the range, one at a time, and each thread keeps the last one. Damaged
// data are an Error; nothing is allocated for a size that the file cannot hold. Any number of threads may
// read.
#pragma once

#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/spool_file.h"

namespace curvisplat {

/// Base64, contiguous or in lines of one length, as MIME has them; the first may be shorter. It ends at its padding,
/// or at the end of its range of the file; reading beyond that is an Error.
class Base64Bytes final : public ByteSource {
 public:
  /// The characters [begin, end) of the file, or fewer.
  Base64Bytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  uint64_t size() const override { return characters_ / 4 * 3; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

  /// Whether the data ends after its first `bytes` bytes (at least 1): the group with the last of them is padded
  /// behind it. A group that is full shows nothing, and false is returned.
  bool endsWith(uint64_t bytes) const;
  /// The base64 that begins with the group after that of the first `bytes` bytes.
  std::shared_ptr<const Base64Bytes> behind(uint64_t bytes) const;

 private:
  static constexpr uint64_t kUnbroken = UINT64_MAX / 4;

  void findLines();
  /// Of a group of four characters, in the file.
  uint64_t position(uint64_t four) const;
  /// Reads groups of four characters without the line breaks, `count` or as many as `text` has room for with them.
  size_t readFours(uint64_t four, size_t count, std::span<std::byte> text) const;

  std::shared_ptr<const PooledFile> file_;
  uint64_t begin_ = 0, end_ = 0;
  uint64_t characters_ = 0;  // without line breaks
  uint64_t first_ = kUnbroken, line_ = kUnbroken,
           break_ = 0;  // characters of the first line, of others, of a break
};

enum class BlockCompressor { kZlib, kLz4, kLzma };

/// The integers in the headers of a file's arrays.
struct HeaderIntegers {
  size_t bytes = 4;  // 4 or 8
  ByteOrder order = ByteOrder::kLittle;

  uint64_t at(std::span<const std::byte> stored) const;
  uint64_t at(const ByteSource& source, uint64_t offset) const;
};

/// Larger blocks are not decompressed in memory.
inline constexpr uint64_t kLargestBlockInMemory = uint64_t{8} << 20;

/// Data in compressed blocks: a table followed by the blocks.
///
///   table    | n | block size | size of the last block | compressed size of block 0 | 1 | ... | n - 1 |
///   blocks   | block 0 | block 1 | ... | block n - 1 |     each a zlib or LZMA stream or an LZ4 block
///
/// The table consists of integers of one size and byte order; a last size of 0 means a full block. The
/// offset of every 1024th block is kept in memory; the table is read again for those between.
class CompressedBytes final : public ByteSource {
 public:
  struct Parts {
    std::shared_ptr<const ByteSource> table, blocks;
    HeaderIntegers integers;
    BlockCompressor compressor = BlockCompressor::kZlib;
    std::string place;  // for error messages: "FILE: array NAME"
  };

  /// Reads the table. Throws Error unless it declares exactly `size` bytes, in blocks of at most
  /// kLargestBlockInMemory whose compressed sizes are possible and fit in the file.
  CompressedBytes(Parts parts, uint64_t size);

  uint64_t size() const override { return size_; }
  /// Decompresses the blocks that overlap the range, and keeps the last one for this thread's next call.
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

 private:
  struct Place {
    uint64_t offset = 0, bytes = 0;  // in parts_.blocks, compressed
  };
  Place placeOf(uint64_t block) const;
  uint64_t bytesOf(uint64_t block) const;
  std::span<const std::byte> unpacked(uint64_t block) const;

  const uint64_t id_;  // unique in the process: identifies the block that a thread has kept
  Parts parts_;
  uint64_t size_ = 0, blocks_ = 0, block_bytes_ = 0;
  std::vector<uint64_t> offsets_;  // of every kTableStride-th block
};

/// The `size` decompressed bytes of `parts`: a CompressedBytes; or, for zlib blocks larger than
/// kLargestBlockInMemory, a spool file that is filled at the first read. Throws Error as CompressedBytes
/// does, and for other blocks of that size.
std::shared_ptr<const ByteSource> compressedBytes(CompressedBytes::Parts parts, uint64_t size,
                                                  const std::shared_ptr<SpoolFile>& spool);

}  // namespace curvisplat
