#include "tools/viewer/background_threads.h"

#include <sys/resource.h>
#include <tbb/info.h>

#include <cstddef>

#include "stream/base/thread_name.h"

namespace curvisplat {
namespace {

/// Of the calling thread alone, and of those that it starts: Linux gives each thread its own.
void lowerPriority(int nice) {
  setpriority(PRIO_PROCESS, 0, nice);
}

}  // namespace

// All places are reserved for threads that call execute(), so that none is left for TBB's own.
BackgroundThreads::BackgroundThreads(int nice)
    : nice_(nice),
      arena_(tbb::info::default_concurrency(), static_cast<unsigned>(tbb::info::default_concurrency())) {
  arena_.initialize();
  const auto count = static_cast<size_t>(tbb::info::default_concurrency() - 1);
  for (size_t n = 0; n < count; ++n) keeping_.push_back(ends_.emplace_back().defer([] {}));
  try {
    for (tbb::task_group& its_end : ends_)
      threads_.emplace_back([this, &its_end] {
        nameThisThread("background");
        lowerPriority(nice_);
        arena_.execute([&its_end] { its_end.wait(); });
      });
  } catch (...) {  // there is no thread to be had
    end();
    throw;
  }
}

BackgroundThreads::~BackgroundThreads() {
  end();
}

void BackgroundThreads::end() {
  keeping_.clear();
  for (std::thread& thread : threads_) thread.join();
  for (tbb::task_group& its_end : ends_) its_end.wait();  // that no thread has waited for
}

void BackgroundThreads::run(const std::function<void()>& work) {
  lowerPriority(nice_);
  arena_.execute(work);
}

}  // namespace curvisplat
