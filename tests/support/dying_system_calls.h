// A process that is killed in the midst of a system call: the way to be interrupted at any moment, twice in
// the same one.
#pragma once

#include <atomic>
#include <cstdint>

#include "stream/base/file.h"

namespace curvisplat::faults {

/// Put in place with ScopedSystemCalls. The call number `die_at` (counted from 0; opening, writing, cutting,
/// syncing, renaming, removing and making folders, and reading if `count_reads`) sends SIGKILL to the process
/// instead of doing its work; of a write, the first half is done.
class DyingSystemCalls : public SystemCalls {
 public:
  int64_t die_at = -1;
  bool count_reads = false;
  std::atomic<int64_t> calls = 0;

  int open(const char* path, int flags, unsigned mode) override;
  ssize_t pread(int fd, void* to, size_t count, int64_t offset) override;
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override;
  int truncate(int fd, int64_t size) override;
  int fsync(int fd) override;  // that is all: what a kill leaves needs no syncing
  int rename(const char* from, const char* to) override;
  int exchange(const char* a, const char* b) override;
  int mkdir(const char* path, unsigned mode) override;
  int remove(const char* path) override;

 private:
  bool isLast() { return calls++ == die_at; }
  void dieIfLast();
};

}  // namespace curvisplat::faults
