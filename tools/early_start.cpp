// This needs glibc and its loader; early_start_left_out.cpp stands in for it elsewhere.
#include "tools/early_start.h"

#include <pthread.h>

#include <hwy/nanobenchmark.h>

#include <cstddef>
#include <cstdint>

namespace curvisplat {
namespace {

// The stack of threads that are started while libraries are loaded.
constexpr size_t kLoadingStackBytes = 256 << 10;
size_t stack_bytes = 0;  // the system's

void prepare(int, char**, char**) {
  beforeLibraries();
  pthread_attr_t attributes;
  if (pthread_getattr_default_np(&attributes) != 0) return;
  pthread_attr_getstacksize(&attributes, &stack_bytes);
  pthread_attr_setstacksize(&attributes, kLoadingStackBytes);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
}

// Called before the initialisers of all libraries.
__attribute__((section(".preinit_array"), used)) void (*const kPrepare)(int, char**, char**) = prepare;

}  // namespace

void endLoadingOfLibraries() {
  pthread_attr_t attributes;
  if (stack_bytes == 0 || pthread_getattr_default_np(&attributes) != 0) return;
  pthread_attr_setstacksize(&attributes, stack_bytes);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
}

}  // namespace curvisplat

// Takes the place of Highway's own, which measures the clock for some milliseconds whenever libhwy is loaded; only its benchmarks use it.
uint64_t hwy::platform::TimerResolution() {
  return 1;
}
