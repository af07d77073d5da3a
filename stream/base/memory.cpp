#include "stream/base/memory.h"

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <new>

#include "stream/base/os.h"

namespace curvisplat {

void preferHugePages(void* begin, size_t bytes) {
  constexpr uintptr_t kHugePage = 2 << 20;
  const auto from = reinterpret_cast<uintptr_t>(begin);
  const uintptr_t first = (from + kHugePage - 1) / kHugePage * kHugePage,
                  end = (from + bytes) / kHugePage * kHugePage;
  if (first >= end) return;
  os::adviseHugePages(reinterpret_cast<void*>(first), end - first);
}

void returnFreedMemory(size_t large) {
  os::returnBlocksFrom(large);
  os::trimHeap();
}

void limitHeaps(int most) {
  os::limitHeaps(most);
}

void requireSpareMemory(size_t bytes) {
  void* const memory =
      ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  ::munmap(memory, bytes);
}

}  // namespace curvisplat
