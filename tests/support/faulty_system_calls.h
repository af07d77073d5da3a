// A disk that misbehaves: short transfers, interruptions, and one failing call, counted from the start.
#pragma once

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <set>
#include <string>

#include "stream/base/file.h"

namespace curvisplat::faults {

/// Put in place with ScopedSystemCalls. Counts may be read and set while no I/O is under way.
class FaultySystemCalls : public SystemCalls {
 public:
  size_t largest_transfer = SIZE_MAX;  // a call moves at most so many bytes
  int interrupt_every = 0;             // every n-th call that may be EINTR is so first
  int64_t fail_write_at = -1;          // this write (counted from 0) and all after it fail with `error`
  int64_t fail_read_at = -1;           // this read and all after it
  int64_t fail_only_read_at = -1;      // this read, and none after it
  int64_t wrong_only_read_at = -1;     // this read gives other bytes than the file has
  int64_t fail_sync_at = -1;
  int64_t fail_rename_at = -1;
  int64_t fail_name_at =
      -1;  // this call that makes a name: of a new file or folder, or a rename; and all after it
  int64_t fail_call_at = -1;       // this call, of whatever kind, and all after it
  int64_t fail_only_call_at = -1;  // this call, of whatever kind, and none after it
  int64_t cut_at = -1;  // at this read of a file whose path begins with `to_be_cut`, it is halved first
  std::string to_be_cut;
  int error = ENOSPC;
  bool refuse_direct_open = false;   // O_DIRECT is EINVAL, as on file systems that lack it
  bool refuse_direct_reads = false;  // only reading is
  bool is_slow = false;              // some transfers let others run first, a few of them long
  bool is_unsynced = false;          // syncing does nothing: no test pulls the plug, and it takes its time

  std::atomic<int64_t> calls = 0, reads = 0, writes = 0, syncs = 0, renames = 0;
  std::atomic<bool> has_failed = false;           // a call, or a file was cut
  std::atomic<bool> has_refused_removal = false;  // then something is left that should not be

  int open(const char* path, int flags, unsigned mode) override;
  int close(int fd) override;  // it is closed, whatever it says
  ssize_t pread(int fd, void* to, size_t count, int64_t offset) override;
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override;
  int truncate(int fd, int64_t size) override;
  int fsync(int fd) override;
  int rename(const char* from, const char* to) override;
  int exchange(const char* a, const char* b) override;  // counts as a rename
  int mkdir(const char* path, unsigned mode) override;
  int remove(const char* path) override;

 private:
  bool callFails();
  bool nameFails();
  bool interrupted();
  int fail();
  void dawdle();
  void cut(int fd);

  std::atomic<int64_t> transfers_ = 0, cuttable_ = 0, names_ = 0;
  std::set<int> direct_;  // descriptors
};

/// How many descriptors this process has open.
size_t openDescriptors();

}  // namespace curvisplat::faults
