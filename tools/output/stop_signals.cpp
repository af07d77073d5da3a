#include "tools/output/stop_signals.h"

#include <signal.h>

#include <atomic>

namespace curvisplat {
namespace {

std::atomic<Progress*> job = nullptr;
std::atomic<int> received = 0;  // the last signal; 0: none
static_assert(std::atomic<Progress*>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

void stopJob(int signal) {
  received = signal;
  if (Progress* progress = job) progress->stop(signal);
}

}  // namespace

StopOnSignals::StopOnSignals(Progress& progress) {
  job = &progress;
  struct sigaction action {};
  action.sa_handler = stopJob;
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_IGN) ::sigaction(signal, &action, nullptr);
  }
  if (const int signal = received) progress.stop(signal);
}

StopOnSignals::~StopOnSignals() {
  job = nullptr;
}

void ignoreFileSizeSignal() {
  struct sigaction action {};
  action.sa_handler = SIG_IGN;
  ::sigaction(SIGXFSZ, &action, nullptr);
}

}  // namespace curvisplat
