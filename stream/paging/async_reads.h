// Reads that go on while the caller does something else: by io_uring, or by threads in pread if the kernel
// refuses io_uring. One thread owns an AsyncReads, and submits and waits; any thread may wake it.
//
//   submit(read) ... submit(read) -> wait() -> a read that has ended, in any order
//
// A read may end short, as pread does, or with EINTR; the submitter then submits the rest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

namespace curvisplat {

struct AsyncRead {
  int fd = -1;
  uint64_t offset = 0;
  std::byte* to = nullptr;  // stays until the read has ended
  size_t count = 0;
  uint64_t tag = 0;  // the caller's, not ~0
};

struct AsyncReadEnd {
  uint64_t tag = 0;
  int64_t result = 0;  // bytes read, 0 at the file's end; -errno where it failed
};

class AsyncReads {
 public:
  /// Waits for all reads under way.
  virtual ~AsyncReads() = default;

  /// For people: "io_uring" or "pread on 8 threads".
  virtual const char* name() const = 0;
  /// At most as many at once as the depth it was made with.
  virtual void submit(const AsyncRead& read) = 0;
  /// Waits until a read ends. Returns nullopt if wake() was called since the last nullopt. Throws Error if
  /// the wait itself fails.
  virtual std::optional<AsyncReadEnd> wait() = 0;
  /// Any thread.
  virtual void wake() = 0;
};

/// Null where the kernel refuses io_uring (old, or forbidden to this process).
std::unique_ptr<AsyncReads> makeUringReads(unsigned depth);
/// Reads with SystemCalls::pread on `depth` threads.
std::unique_ptr<AsyncReads> makeThreadReads(unsigned depth);

}  // namespace curvisplat
