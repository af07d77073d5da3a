#include "tests/support/faulty_system_calls.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <thread>

namespace curvisplat::faults {

bool FaultySystemCalls::callFails() {
  const int64_t number = calls++;
  return (fail_call_at >= 0 && number >= fail_call_at) || number == fail_only_call_at;
}

bool FaultySystemCalls::nameFails() {
  const int64_t number = names_++;
  return fail_name_at >= 0 && number >= fail_name_at;
}

bool FaultySystemCalls::interrupted() {
  if (interrupt_every == 0 || ++transfers_ % interrupt_every != 0) return false;
  errno = EINTR;
  return true;
}

int FaultySystemCalls::fail() {
  has_failed = true;
  errno = error;
  return -1;
}

/// One transfer in nine, since a yield takes milliseconds where others want to run.
void FaultySystemCalls::dawdle() {
  if (!is_slow) return;
  for (int64_t n = transfers_++ * 2654435761 % 97 - 85; n > 0; --n) std::this_thread::yield();
}

/// Cuts the file off if it is this one's turn.
void FaultySystemCalls::cut(int fd) {
  const std::string link = "/proc/self/fd/" + std::to_string(fd);
  const std::string path = std::filesystem::read_symlink(link);
  struct stat status {};
  if (!path.starts_with(to_be_cut) || cuttable_++ != cut_at || ::fstat(fd, &status) != 0) return;
  has_failed = ::truncate(path.c_str(), status.st_size / 2) == 0;
}

int FaultySystemCalls::open(const char* path, int flags, unsigned mode) {
  if (interrupted()) return -1;
  if (callFails()) return fail();
  if ((flags & O_CREAT) != 0 && ::access(path, F_OK) != 0 && nameFails()) return fail();
  if (refuse_direct_open && (flags & O_DIRECT)) {
    errno = EINVAL;
    return -1;
  }
  const int fd = SystemCalls::open(path, flags, mode);
  if (refuse_direct_reads && (flags & O_DIRECT)) direct_.insert(fd);
  return fd;
}

int FaultySystemCalls::close(int fd) {
  const int result = SystemCalls::close(fd);
  return callFails() ? fail() : result;
}

ssize_t FaultySystemCalls::pread(int fd, void* to, size_t count, int64_t offset) {
  dawdle();
  if (interrupted()) return -1;
  if (refuse_direct_reads && direct_.contains(fd)) {
    errno = EINVAL;
    return -1;
  }
  const int64_t number = reads++;
  if (callFails()) return fail();
  if ((fail_read_at >= 0 && number >= fail_read_at) || number == fail_only_read_at) return fail();
  if (cut_at >= 0) cut(fd);
  const ssize_t got = SystemCalls::pread(fd, to, std::min(count, largest_transfer), offset);
  if (number == wrong_only_read_at)
    for (ssize_t n = 0; n < got; ++n) static_cast<char*>(to)[n] ^= 0x55;
  return got;
}

ssize_t FaultySystemCalls::pwrite(int fd, const void* from, size_t count, int64_t offset) {
  dawdle();
  if (interrupted()) return -1;
  const int64_t number = writes++;
  if (callFails()) return fail();
  if (fail_write_at >= 0 && number >= fail_write_at) return fail();
  return SystemCalls::pwrite(fd, from, std::min(count, largest_transfer), offset);
}

int FaultySystemCalls::truncate(int fd, int64_t size) {
  if (interrupted()) return -1;
  return callFails() ? fail() : SystemCalls::truncate(fd, size);
}

int FaultySystemCalls::fsync(int fd) {
  if (interrupted()) return -1;
  const int64_t number = syncs++;
  if (callFails()) return fail();
  if (fail_sync_at >= 0 && number >= fail_sync_at) return fail();
  return is_unsynced ? 0 : SystemCalls::fsync(fd);
}

int FaultySystemCalls::rename(const char* from, const char* to) {
  const int64_t number = renames++;
  if (callFails()) return fail();
  if ((fail_rename_at >= 0 && number >= fail_rename_at) || nameFails()) return fail();
  return SystemCalls::rename(from, to);
}

int FaultySystemCalls::exchange(const char* a, const char* b) {
  const int64_t number = renames++;
  if (callFails()) return fail();
  if ((fail_rename_at >= 0 && number >= fail_rename_at) || nameFails()) return fail();
  return SystemCalls::exchange(a, b);
}

int FaultySystemCalls::mkdir(const char* path, unsigned mode) {
  return callFails() || nameFails() ? fail() : SystemCalls::mkdir(path, mode);
}

int FaultySystemCalls::remove(const char* path) {
  if (!callFails()) return SystemCalls::remove(path);
  has_refused_removal = true;
  return fail();
}

size_t openDescriptors() {
  size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

}  // namespace curvisplat::faults
