#include "stream/base/spare_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <new>

namespace curvisplat {
namespace {

uint64_t mappedBytes() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

/// Whether requireSpareMemory() throws where the process may map `spare_bytes` more, tried in a process of its own.
bool isRefusedWith(uint64_t spare_bytes) {
  const pid_t child = ::fork();
  if (child == 0) {
    const rlim_t most = mappedBytes() + spare_bytes;
    const rlimit limit{most, most};
    ::setrlimit(RLIMIT_AS, &limit);
    try {
      requireSpareMemory();
    } catch (const std::bad_alloc&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status)) << status;
  return WEXITSTATUS(status) == 1;
}

TEST(SpareMemory, IsRequiredWithinALimitOfAddressSpace) {
  EXPECT_TRUE(isRefusedWith(uint64_t{16} << 20));
  EXPECT_FALSE(isRefusedWith(uint64_t{64} << 20));
}

TEST(SpareMemory, IsGivenBack) {
  const uint64_t before = mappedBytes();
  for (int n = 0; n < 10; ++n) requireSpareMemory();
  EXPECT_LT(mappedBytes(), before + (uint64_t{32} << 20));
}

}  // namespace
}  // namespace curvisplat
