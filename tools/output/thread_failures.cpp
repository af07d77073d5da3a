#include "tools/output/thread_failures.h"

#include <pthread.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

namespace curvisplat {
namespace {

constexpr size_t kLoadingStackBytes = 256 << 10;
size_t stack_bytes = 0;  // the system's

void print(std::string_view text) {
  // Nothing that allocates, and nothing of the C++ library, which may not be ready yet.
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
}

/// Of an exception that nobody can catch: a library throws it before main(), or in a thread of its own.
[[noreturn]] void onTerminate() {
  try {
    if (std::current_exception()) throw;
  } catch (const std::bad_alloc&) {
    print("curvisplat: out of memory; lower --memory or --size, or use a machine with more memory\n");
    ::_exit(1);
  } catch (const std::exception& error) {
    // TBB throws a runtime_error with this text.
    if (std::strstr(error.what(), std::strerror(EAGAIN))) {
      print(
          "curvisplat: cannot start a thread; raise the limits of processes and memory (ulimit -u, ulimit "
          "-v)\n");
      ::_exit(1);
    }
    print("curvisplat: internal error: ");
    print(error.what());
    print("\n");
  } catch (...) {
  }
  std::abort();
}

void prepare(int, char**, char**) {
  std::set_terminate(onTerminate);
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
