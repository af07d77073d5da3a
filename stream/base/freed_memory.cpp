#include "stream/base/freed_memory.h"

#include <malloc.h>

namespace curvisplat {

void returnFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, 4 << 20);
  malloc_trim(0);
}

}  // namespace curvisplat
