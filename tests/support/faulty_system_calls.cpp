#include "tests/support/faulty_system_calls.h"

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

ssize_t FaultySystemCalls::pread(int fd, void* to, size_t count, int64_t offset) {
  if (interrupted()) return -1;
  const int64_t number = reads++;
  if (fail_read_at >= 0 && number >= fail_read_at) return fail();
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
