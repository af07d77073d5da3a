#include "stream/base/freed_memory.h"

#include <malloc.h>

namespace curvisplat {

void returnFreedMemory(size_t large) {
  mallopt(M_MMAP_THRESHOLD, static_cast<int>(large));
  malloc_trim(0);
}

void limitHeaps(int most) {
  mallopt(M_ARENA_MAX, most);
}

}  // namespace curvisplat
