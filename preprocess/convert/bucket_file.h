// The temporary data of conversion: one file, in which each bucket's records form four chains of chunks. A
// chunk is what one bucket's buffer held when it was full, so writes are large whatever order the splats come
// in, and the memory of a bucket is its buffer and four offsets. Chains are equally long: four threads can
// read a bucket.
//
//    chunk:  checksum of what follows                           uint64
//            offset of its chain's chunk before, or kNoChunk    uint64
//            bytes of records that follow                       uint64
//            whole records
//            zeros up to a multiple of kDirectAlignment
//
// It is written once, read once, and larger than memory, so it bypasses the page cache. It is synced only if
// another machine will read it, so the disk may lose a part of it in a power failure. A conversion that is
// resumed finds that by the checksums.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {

/// A file that an interrupted conversion has left is missing or damaged: it has to be made again.
class LostBuckets : public Error {
 public:
  using Error::Error;
};

/// The state that another process needs, besides the file, to read it.
struct BucketChains {
  static constexpr size_t kCount = 4;  // of a bucket
  static constexpr uint64_t kNoChunk = UINT64_MAX;
  struct OfBucket {
    std::array<uint64_t, kCount> last_chunks{kNoChunk, kNoChunk, kNoChunk, kNoChunk};  // offsets
    uint64_t bytes = 0;                                                                // of records
  };
  uint64_t chunk_bytes = 0;
  uint64_t size = 0;             // of the file
  std::vector<OfBucket> chains;  // [bucket]
};

class BucketFile {
 public:
  /// Makes `path`. A bucket has a buffer of `chunk_bytes`, a multiple of kDirectAlignment, while it has unwritten
  /// records. Up to four more buffers may be waiting for the disk.
  BucketFile(const std::filesystem::path& path, uint32_t buckets, size_t chunk_bytes);
  /// Opens a file that another process has made, to read or to append more. Checks each chunk that is read: throws LostBuckets
  /// here or when reading if the file has changed.
  enum class Access { kRead, kAppend };
  BucketFile(const std::filesystem::path& path, BucketChains chains, Access access = Access::kRead);
  /// Removes the file, unless leave() was called.
  ~BucketFile();
  void leave();

  static constexpr size_t kWaitingChunks = 4;

  uint32_t buckets() const;

  /// Adds whole records, of chunk_bytes at most, to a bucket. Any thread; waits while the disk is behind.
  /// Throws Error once the disk has failed.
  void append(uint32_t bucket, std::span<const std::byte> records);

  /// Writes what is in the buffers: chains() then has all that was appended. Nothing may be appended meanwhile.
  void flush();
  /// Writes what is left in the buffers and frees them. Reading is possible from here on, by any thread;
  /// nothing can be appended. `sync`: another machine will read it.
  void close(bool sync = false);

  /// Adds the records of another rank's file, which has the same buckets, to those that are read. Call it
  /// after close(). That file is not removed. Throws as the second constructor does.
  void join(const std::filesystem::path& path, BucketChains chains);

  /// The chains of this rank's own file.
  BucketChains chains() const;
  uint64_t bytes(uint32_t bucket) const;
  /// Reads all records of a bucket, in no particular order. Overwrites `out` and keeps its capacity.
  void read(uint32_t bucket, std::vector<std::byte>& out) const;
  /// Calls `use` with each chunk of a bucket; a chunk has whole records.
  void forEachChunk(uint32_t bucket, const std::function<void(std::span<const std::byte>)>& use) const;
  /// Calls `use` with each chunk of one of its chains, 0 to BucketChains::kCount - 1.
  void forEachChunk(uint32_t bucket, size_t chain,
                    const std::function<void(std::span<const std::byte>)>& use) const;

  /// Bytes of the whole file.
  uint64_t size() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
