#include "tools/output/required_threads.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/mutex.h"
#include "stream/base/spare_memory.h"
#include "stream/base/thread_count.h"

namespace curvisplat {
namespace {

constexpr unsigned kOwnThreads = 4;  // reading ahead, writing, paging, OpenGL
constexpr unsigned kMaxTried = 64;   // memory may allow fewer threads than --threads
constexpr const char* kAdvice = "raise the limits of processes and memory (ulimit -u, ulimit -v)";

void tryThreads(unsigned count, const std::string& hint) {
  count = std::min(threadsOrCores(count), kMaxTried) + kOwnThreads;
  Mutex mutex;  // guards `ending`
  bool ending = false;
  ConditionVariable changed;
  std::vector<std::thread> threads;
  threads.reserve(count);
  int error = 0;
  try {
    while (threads.size() < count)
      threads.emplace_back([&] {
        MutexLock lock(mutex);
        while (!ending) changed.wait(lock);
      });
    requireSpareMemory();
  } catch (const std::system_error& failure) {
    error = failure.code().value();
  } catch (const std::bad_alloc&) {
    error = ENOMEM;
  }
  {
    const MutexLock lock(mutex);
    ending = true;
  }
  changed.notify_all();
  for (std::thread& thread : threads) thread.join();
  if (error != 0) throw Error("cannot start {} threads: {}; {}", count, std::strerror(error), hint);
}

}  // namespace

const char* const kNoThread =
    "cannot start a thread: the system has none left; raise the limits of processes and memory (ulimit -u, "
    "ulimit -v)";

void requireThreads(unsigned count, std::string_view option) {
  tryThreads(count, fmt::format("lower {}, or {}", option, kAdvice));
}

void requireThreads() {
  tryThreads(0, kAdvice);
}

bool isForLackOfThreads(const std::exception& error) {
  const auto* const system = dynamic_cast<const std::system_error*>(&error);
  return (system && system->code() == std::errc::resource_unavailable_try_again) ||
         std::string_view(error.what()).starts_with("pthread_create");
}

}  // namespace curvisplat
