#include "tests/support/dying_system_calls.h"

#include <signal.h>
#include <unistd.h>

namespace curvisplat::faults {
namespace {

[[noreturn]] void die() {
  ::kill(::getpid(), SIGKILL);
  for (;;) ::pause();
}

}  // namespace

void DyingSystemCalls::dieIfLast() {
  if (isLast()) die();
}

int DyingSystemCalls::open(const char* path, int flags, unsigned mode) {
  dieIfLast();
  return SystemCalls::open(path, flags, mode);
}

ssize_t DyingSystemCalls::pread(int fd, void* to, size_t count, int64_t offset) {
  if (count_reads) dieIfLast();
  return SystemCalls::pread(fd, to, count, offset);
}

ssize_t DyingSystemCalls::pwrite(int fd, const void* from, size_t count, int64_t offset) {
  if (isLast()) {
    SystemCalls::pwrite(fd, from, count / 2, offset);
    die();
  }
  return SystemCalls::pwrite(fd, from, count, offset);
}

int DyingSystemCalls::truncate(int fd, int64_t size) {
  dieIfLast();
  return SystemCalls::truncate(fd, size);
}

int DyingSystemCalls::fsync(int) {
  dieIfLast();
  return 0;
}

int DyingSystemCalls::rename(const char* from, const char* to) {
  dieIfLast();
  return SystemCalls::rename(from, to);
}

int DyingSystemCalls::exchange(const char* a, const char* b) {
  dieIfLast();
  return SystemCalls::exchange(a, b);
}

int DyingSystemCalls::mkdir(const char* path, unsigned mode) {
  dieIfLast();
  return SystemCalls::mkdir(path, mode);
}

int DyingSystemCalls::remove(const char* path) {
  dieIfLast();
  return SystemCalls::remove(path);
}

}  // namespace curvisplat::faults
