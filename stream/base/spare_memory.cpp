#include "stream/base/spare_memory.h"

#include <sys/mman.h>

#include <cstddef>
#include <new>

namespace curvisplat {
namespace {

constexpr size_t kSpareBytes = size_t{32} << 20;

}  // namespace

void requireSpareMemory() {
  void* const memory = ::mmap(nullptr, kSpareBytes, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  ::munmap(memory, kSpareBytes);
}

}  // namespace curvisplat
