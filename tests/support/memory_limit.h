// The memory that tests may judge: how much address space this process has, a limit on how much more it may
// take, and whether this is a build with sanitizers, of GCC or Clang. What these need of memory is not the
// program's, so tests that limit or measure memory leave that out.
#pragma once

#include <sys/resource.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>

namespace curvisplat {

constexpr bool kHasAddressSanitizer =
#if defined(__has_feature)
    __has_feature(address_sanitizer);
#elif defined(__SANITIZE_ADDRESS__)
    true;
#else
    false;
#endif

/// The thread sanitizer does not work in a process that a process with threads has forked.
constexpr bool kHasThreadSanitizer =
#if defined(__has_feature)
    __has_feature(thread_sanitizer);
#elif defined(__SANITIZE_THREAD__)
    true;
#else
    false;
#endif

constexpr bool kIsSanitized = kHasAddressSanitizer || kHasThreadSanitizer;

}  // namespace curvisplat

namespace curvisplat::test {

/// The address space that this process has.
inline uint64_t mappedBytes() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

/// A limit of memory: until its end, this process may not take more than `more_bytes` of address space beside
/// what it has. Not for programs with a sanitizer, which takes much more for itself.
class MemoryLimit {
 public:
  explicit MemoryLimit(uint64_t more_bytes) {
    ::getrlimit(RLIMIT_AS, &before_);
    rlimit limit = before_;
    limit.rlim_cur = mappedBytes() + more_bytes;
    ::setrlimit(RLIMIT_AS, &limit);
  }
  ~MemoryLimit() { ::setrlimit(RLIMIT_AS, &before_); }
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

 private:
  rlimit before_{};
};

}  // namespace curvisplat::test
