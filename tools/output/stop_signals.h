// SIGINT, SIGTERM and SIGHUP as a wish to stop: the first asks the job to, the second ends the process as
// ever.
#pragma once

#include <signal.h>

#include <array>

#include "stream/base/progress.h"

namespace curvisplat {

/// While it lives, those of the signals that are not ignored call progress.stop(). One at a time; for the
/// main thread.
class StopOnSignals {
 public:
  explicit StopOnSignals(Progress& progress);
  ~StopOnSignals();
  StopOnSignals(const StopOnSignals&) = delete;
  StopOnSignals& operator=(const StopOnSignals&) = delete;

 private:
  static constexpr std::array<int, 3> kSignals{SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, kSignals.size()> before_{};
};

}  // namespace curvisplat
