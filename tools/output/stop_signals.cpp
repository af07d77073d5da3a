#include "tools/output/stop_signals.h"

#include <atomic>
#include <cstddef>

namespace curvisplat {
namespace {

std::atomic<Progress*> job = nullptr;
static_assert(std::atomic<Progress*>::is_always_lock_free);

void stopJob(int signal) {
  if (Progress* progress = job) progress->stop(signal);
}

}  // namespace

StopOnSignals::StopOnSignals(Progress& progress) {
  job = &progress;
  struct sigaction action {};
  action.sa_handler = stopJob;
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  for (size_t n = 0; n < kSignals.size(); ++n) {
    ::sigaction(kSignals[n], nullptr, &before_[n]);
    if (before_[n].sa_handler != SIG_IGN) ::sigaction(kSignals[n], &action, nullptr);
  }
}

StopOnSignals::~StopOnSignals() {
  for (size_t n = 0; n < kSignals.size(); ++n) ::sigaction(kSignals[n], &before_[n], nullptr);
  job = nullptr;
}

void ignoreFileSizeSignal() {
  struct sigaction action {};
  action.sa_handler = SIG_IGN;
  ::sigaction(SIGXFSZ, &action, nullptr);
}

}  // namespace curvisplat
