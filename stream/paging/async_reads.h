// Reads that go on while the caller does something else, and the files that they read from.
//
// A DirectFile bypasses the page cache where it can: a cache much larger than memory would evict everything
// else, and the kernel's read-ahead guesses wrong in an octree. An AsyncReads reads by io_uring, or by
// threads in pread if the kernel refuses io_uring. One thread owns it, submits reads and waits for them; any
// thread may wake that one.
//
//   submit(read) ... submit(read) -> wait() -> a read that has ended, in any order
//
// A read may end early, as pread does, or with EINTR; the owner then submits the rest. Nothing of liburing
// is in this header.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

namespace curvisplat {

/// A file opened for reading, with O_DIRECT where the file system allows it. Direct reads need offsets,
/// lengths and addresses that are multiples of kPageBytes (stream/cache/cache_format.h). Reads that cannot
/// be direct (the file system refuses O_DIRECT, or a short read ended at an unaligned byte) use the second,
/// buffered descriptor. Immutable: any thread may read.
class DirectFile {
 public:
  /// `direct`: try O_DIRECT. Throws Error if `path` cannot be opened.
  explicit DirectFile(std::filesystem::path path, bool direct = true);
  ~DirectFile();
  DirectFile(const DirectFile&) = delete;
  DirectFile& operator=(const DirectFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  bool isDirect() const { return direct_fd_ >= 0; }
  /// -1 if the file system refused O_DIRECT.
  int directFd() const { return direct_fd_; }
  int bufferedFd() const { return buffered_fd_; }

 private:
  std::filesystem::path path_;
  int direct_fd_ = -1, buffered_fd_ = -1;
};

/// A read to be submitted.
struct AsyncRead {
  int fd = -1;
  uint64_t offset = 0;
  std::byte* to = nullptr;  // stays until the read has ended
  size_t count = 0;
  uint64_t tag = 0;  // the caller's, not ~0
};

/// The end of a read.
struct AsyncReadEnd {
  uint64_t tag = 0;
  int64_t result = 0;  // bytes read, 0 at the file's end; -errno where it failed
};

/// Reads under way, which their destructor waits for.
class AsyncReads {
 public:
  /// Waits for all reads under way.
  virtual ~AsyncReads() = default;

  /// The method, for people: "io_uring" or "pread on 8 threads".
  virtual const char* name() const = 0;
  /// Starts a read. At most `depth` (below) may be under way at once.
  virtual void submit(const AsyncRead& read) = 0;
  /// Waits until a read ends. Returns nullopt if wake() was called since the last nullopt. Throws Error if
  /// the wait itself fails.
  virtual std::optional<AsyncReadEnd> wait() = 0;
  /// Makes wait() return nullopt. Any thread.
  virtual void wake() = 0;
};

/// Reads by io_uring. Null if the kernel refuses it, because it is too old or forbids it to this process.
std::unique_ptr<AsyncReads> makeUringReads(unsigned depth);
/// Reads by SystemCalls::pread on `depth` threads.
std::unique_ptr<AsyncReads> makeThreadReads(unsigned depth);

}  // namespace curvisplat
