#include "tests/support/faulty_system_calls.h"

#include <fcntl.h>

#include <algorithm>

namespace curvisplat::testing {

bool FaultySystemCalls::interrupted() {
  if (interrupt_every == 0 || ++transfers_ % interrupt_every != 0) return false;
  errno = EINTR;
  return true;
}

int FaultySystemCalls::fail() const {
  errno = error;
  return -1;
}

int FaultySystemCalls::open(const char* path, int flags, unsigned mode) {
  if (refuse_direct_open && (flags & O_DIRECT)) {
    errno = EINVAL;
    return -1;
  }
  const int fd = SystemCalls::open(path, flags, mode);
  if (flags & O_DIRECT) direct_.insert(fd);
  return fd;
}

ssize_t FaultySystemCalls::pread(int fd, void* to, size_t count, int64_t offset) {
  if (interrupted()) return -1;
  if (refuse_direct_reads && direct_.contains(fd)) {
    errno = EINVAL;
    return -1;
  }
  const int64_t number = reads++;
  if ((fail_read_at >= 0 && number >= fail_read_at) || number == fail_only_read_at) return fail();
  return SystemCalls::pread(fd, to, std::min(count, largest_transfer), offset);
}

ssize_t FaultySystemCalls::pwrite(int fd, const void* from, size_t count, int64_t offset) {
  if (interrupted()) return -1;
  const int64_t number = writes++;
  if (fail_write_at >= 0 && number >= fail_write_at) return fail();
  return SystemCalls::pwrite(fd, from, std::min(count, largest_transfer), offset);
}

int FaultySystemCalls::fsync(int fd) {
  const int64_t number = syncs++;
  if (fail_sync_at >= 0 && number >= fail_sync_at) return fail();
  return SystemCalls::fsync(fd);
}

int FaultySystemCalls::rename(const char* from, const char* to) {
  const int64_t number = renames++;
  if (fail_rename_at >= 0 && number >= fail_rename_at) return fail();
  return SystemCalls::rename(from, to);
}

int FaultySystemCalls::exchange(const char* a, const char* b) {
  const int64_t number = renames++;
  if (fail_rename_at >= 0 && number >= fail_rename_at) return fail();
  return SystemCalls::exchange(a, b);
}

}  // namespace curvisplat::testing
