#include "stream/base/huge_pages.h"

#include <sys/mman.h>

#include <cstdint>

namespace curvisplat {

void preferHugePages(void* begin, size_t bytes) {
  constexpr uintptr_t kHugePage = 2 << 20;
  const auto from = reinterpret_cast<uintptr_t>(begin);
  const uintptr_t first = (from + kHugePage - 1) / kHugePage * kHugePage,
                  end = (from + bytes) / kHugePage * kHugePage;
  if (first >= end) return;
  madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE);
}

}  // namespace curvisplat
