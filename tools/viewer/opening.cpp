#include "tools/viewer/opening.h"

#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <utility>

#include "stream/base/thread_name.h"

namespace curvisplat {
namespace {

constexpr int kNice = 10;  // of the threads that convert: the window and its picture come first

}  // namespace

Opening::Opening(std::vector<std::filesystem::path> files, const ViewerOptions& options, void (*wake)())
    : files_(std::move(files)), progress_([this, wake](const Progress::State* state) {
        if (!state) return;
        {
          const MutexLock lock(mutex_);
          phase_ = state->phase;
          const uint64_t done = state->done + state->skipped;
          part_ = state->total > 0 ? static_cast<float>(done) / static_cast<float>(state->total) : 0;
        }
        wake();
      }) {
  cache_ = std::async(std::launch::async, [this, wake, to_cache = options.to_cache] {
    nameThisThread("opening");
    // Of this thread alone, and of those that it starts: Linux gives each thread its own.
    setpriority(PRIO_PROCESS, 0, kNice);
    struct Wake {
      void (*wake)();
      ~Wake() { wake(); }
    } const at_the_end{wake};
    return to_cache(files_, progress_, [this](const std::string& text) {
      const MutexLock lock(mutex_);
      messages_.push_back(text);
    });
  });
}

Opening::~Opening() {
  progress_.stop(SIGTERM);
  if (cache_.valid()) cache_.wait();
}

std::string Opening::phase() const {
  const MutexLock lock(mutex_);
  return phase_;
}

float Opening::part() const {
  const MutexLock lock(mutex_);
  return part_;
}

std::vector<std::string> Opening::takeMessages() {
  const MutexLock lock(mutex_);
  return std::exchange(messages_, {});
}

bool Opening::isDone() const {
  return cache_.valid() && cache_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace curvisplat
