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

Opening::Opening(std::string title, Work work, void (*wake)())
    : title_(std::move(title)), phase_("reading"), progress_([this, wake](const Progress::State* state) {
        if (!state) return;
        {
          const MutexLock lock(mutex_);
          phase_ = state->phase;
          const uint64_t done = state->done + state->skipped;
          part_ = state->total > 0 ? static_cast<float>(done) / static_cast<float>(state->total) : 0;
        }
        wake();
      }) {
  cache_ = std::async(std::launch::async, [this, wake, work = std::move(work)] {
    nameThisThread("opening");
    // Of this thread alone, and of those that it starts: Linux gives each thread its own.
    setpriority(PRIO_PROCESS, 0, kNice);
    struct Wake {
      void (*wake)();
      ~Wake() { wake(); }
    } const at_the_end{wake};
    OpeningEvents events;
    events.say = [this](const std::string& text) {
      const MutexLock lock(mutex_);
      messages_.push_back(text);
    };
    events.reorder = [this](const std::vector<std::filesystem::path>& files) {
      const MutexLock lock(mutex_);
      files_ = files;
    };
    events.preview = [this, wake](Preview preview) {
      {
        const MutexLock lock(mutex_);
        preview_ = std::move(preview);
      }
      wake();
    };
    return work(progress_, events);
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

std::vector<std::filesystem::path> Opening::takeFiles() {
  const MutexLock lock(mutex_);
  return std::exchange(files_, {});
}

std::optional<Preview> Opening::takePreview() {
  const MutexLock lock(mutex_);
  return std::exchange(preview_, std::nullopt);
}

bool Opening::isDone() const {
  return cache_.valid() && cache_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace curvisplat
