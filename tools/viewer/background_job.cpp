#include "tools/viewer/background_job.h"

#include <chrono>
#include <csignal>
#include <utility>

#include "stream/base/thread_name.h"
#include "tools/viewer/background_threads.h"

namespace curvisplat {
namespace {

constexpr int kNice = 10;  // the window and its picture come first

}  // namespace

BackgroundJob::BackgroundJob(std::string title, std::string phase, Work work, void (*wake)())
    : title_(std::move(title)),
      phase_(std::move(phase)),
      progress_([this, wake](const Progress::State* state) {
        if (!state) return;
        {
          const MutexLock lock(mutex_);
          phase_ = state->phase;
          const uint64_t done = state->done + state->skipped;
          part_ = state->total > 0 ? static_cast<float>(done) / static_cast<float>(state->total) : 0;
        }
        wake();
      }) {
  made_ = std::async(std::launch::async, [this, wake, work = std::move(work)] {
    nameThisThread("job");
    struct Wake {
      void (*call)();
      ~Wake() { call(); }
    } const at_the_end{wake};
    BackgroundThreads threads(kNice);
    std::filesystem::path made;
    threads.run([&] { made = work(progress_); });
    return made;
  });
}

BackgroundJob::~BackgroundJob() {
  progress_.stop(SIGTERM);
  if (made_.valid()) made_.wait();
}

std::string BackgroundJob::phase() const {
  const MutexLock lock(mutex_);
  return phase_;
}

float BackgroundJob::part() const {
  const MutexLock lock(mutex_);
  return part_;
}

bool BackgroundJob::isDone() const {
  return made_.valid() && made_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace curvisplat
