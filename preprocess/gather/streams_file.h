// Many streams of records in one temporary file. Each is read back in the order in which it was written: unlike
// convert's BucketFile, which any thread may append to and whose order says nothing. Sums that follow the order of
// a stream are the same for any number of threads and any memory.
//
// A stream is a chain of chunks; the first chunks stay in memory as long as there is space, and a small mesh makes
// no file at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "stream/base/temporary_files.h"

namespace curvisplat {

/// append() is for one thread at a time, and ends with close(). Then any thread may read.
class StreamsFile {
 public:
  /// Each stream has a buffer; all of them, and the chunks that stay, are within `memory_bytes`, but for records
  /// that are larger than a buffer.
  StreamsFile(ScratchFiles scratch, size_t streams, uint64_t memory_bytes);
  ~StreamsFile();

  size_t streams() const { return streams_.size(); }
  /// Adds a whole record. Throws Error if the disk fails.
  void append(size_t stream, std::span<const std::byte> record);
  template <typename Record>
  void appendRecord(size_t stream, const Record& record) {
    static_assert(std::is_trivially_copyable_v<Record>);
    append(stream, std::as_bytes(std::span(&record, 1)));
  }
  void close();

  uint64_t bytes(size_t stream) const { return streams_[stream].bytes; }
  /// Calls use(records), whole ones, in the order in which they were appended. Throws Error if the disk fails.
  void forEach(size_t stream, const std::function<void(std::span<const std::byte>)>& use) const;
  /// Frees the memory that a stream has.
  void forget(size_t stream) { streams_[stream] = {}; }

  static constexpr size_t kMinBuffer = size_t{16} << 10, kMaxBuffer = size_t{256} << 10;
  /// Bytes that do not stay in memory, of `bytes` in streams alike.
  static uint64_t bytesInFile(uint64_t bytes, size_t streams, uint64_t memory_bytes);
  /// The number of streams whose buffers fit in that memory.
  static size_t mostStreams(uint64_t memory_bytes) { return memory_bytes / (2 * kMinBuffer) + 1; }

 private:
  struct Chunk {
    uint64_t offset = 0, bytes = 0;    // in the file
    std::vector<std::byte> in_memory;  // instead
  };
  struct Stream {
    std::vector<std::byte> buffer;
    std::vector<Chunk> chunks;
    uint64_t bytes = 0;
  };
  void flush(Stream& stream);
  static uint64_t bufferBytes(size_t streams, uint64_t memory_bytes);
  static uint64_t bytesThatStay(size_t streams, uint64_t memory_bytes);

  ScratchFiles scratch_;
  std::vector<Stream> streams_;
  size_t buffer_bytes_;
  uint64_t may_stay_;  // bytes of further chunks that may stay in memory
  std::unique_ptr<NamelessFile> file_;
};

}  // namespace curvisplat
