// A conversion that is killed at a given system call, for tests of what it leaves:
//
//    dying_convert GRID FUNCTION OUTPUT BUCKET_SPLATS KILL_AT writes|all [resume] [overwrite] [surfaces]
//
// Converts the first scalar. If the conversion ends before it is killed (KILL_AT -1: always), prints the
// number of calls. The kill comes in the midst of the call, so that a conversion can be interrupted at any
// moment, and twice in the same one.
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <span>
#include <string>

#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/file.h"

namespace curvisplat::faults {
namespace {

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

[[noreturn]] void die() {
  ::kill(::getpid(), SIGKILL);
  for (;;) ::pause();
}

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

}  // namespace
}  // namespace curvisplat::faults

int main(int argc, char** argv) {
  using namespace curvisplat;
  try {
    const std::span<char*> words(argv, static_cast<size_t>(argc));
    const auto says = [&](const std::string& word) {
      return std::find(words.begin() + 6, words.end(), word) != words.end();
    };
    OpenGridOptions grid;
    grid.grid = words[1];
    grid.solutions = {words[2]};
    ConvertOptions options;
    options.output = words[3];
    options.limits.bucket_splats = std::stoull(words[4]);
    options.scalars = {0};
    options.memory_bytes = leastMemory(1);
    options.title = "killed";
    options.resume = says("resume");
    options.surfaces = says("surfaces");
    options.overwrite = says("overwrite");
    const auto source = openGrid(grid);

    faults::DyingSystemCalls calls;
    calls.die_at = std::stoll(words[5]);
    calls.count_reads = says("all");
    const ScopedSystemCalls scope(calls);
    Progress progress;
    convert(*source, options, progress);
    fmt::print("{}\n", calls.calls.load());
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
