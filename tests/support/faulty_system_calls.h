// A disk that misbehaves: short transfers, interruptions, and one failing call, counted from the start.
#pragma once

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <set>

#include "stream/file.h"

namespace curvisplat::testing {

/// Put in place with ScopedSystemCalls. Counts may be read and set while no I/O is under way.
class FaultySystemCalls : public SystemCalls {
 public:
  size_t largest_transfer = SIZE_MAX;  // a call moves at most so many bytes
  int interrupt_every = 0;             // every n-th read or write is EINTR first
  int64_t fail_write_at = -1;          // this write (counted from 0) and all after it fail with `error`
  int64_t fail_read_at = -1;           // this read and all after it
  int64_t fail_only_read_at = -1;      // this read, and none after it
  int64_t fail_sync_at = -1;
  int64_t fail_rename_at = -1;
  int error = ENOSPC;
  bool refuse_direct_open = false;   // O_DIRECT is EINVAL, as on file systems that lack it
  bool refuse_direct_reads = false;  // only reading is

  std::atomic<int64_t> reads = 0, writes = 0, syncs = 0, renames = 0;

  int open(const char* path, int flags, unsigned mode) override;
  ssize_t pread(int fd, void* to, size_t count, int64_t offset) override;
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override;
  int fsync(int fd) override;
  int rename(const char* from, const char* to) override;
  int exchange(const char* a, const char* b) override;  // counts as a rename

 private:
  bool interrupted();
  int fail() const;

  std::atomic<int64_t> transfers_ = 0;
  std::set<int> direct_;  // descriptors
};

}  // namespace curvisplat::testing
