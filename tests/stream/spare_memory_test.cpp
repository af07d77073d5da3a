#include "stream/base/spare_memory.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <new>

#include "tests/support/memory_limit.h"

namespace curvisplat {
namespace {

using test::mappedBytes;

/// Whether requireSpareMemory() throws where the process may map `spare_bytes` more, tried in a process of its own.
bool isRefusedWith(uint64_t spare_bytes) {
  const pid_t child = ::fork();
  if (child == 0) {
    const test::MemoryLimit limit(spare_bytes);
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
