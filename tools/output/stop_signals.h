// SIGINT, SIGTERM and SIGHUP: the first one asks the running job to stop, a second one ends the process.
#pragma once

#include "stream/base/progress.h"

namespace curvisplat {

/// During its lifetime these signals, unless they were ignored, call progress.stop(). A signal between two jobs
/// stops the next one. After the last, the process ends as if there had been none: its files are complete, and a
/// shell is told so. At most one instance at a time, on the main thread.
class StopOnSignals {
 public:
  explicit StopOnSignals(Progress& progress);
  ~StopOnSignals();
  StopOnSignals(const StopOnSignals&) = delete;
  StopOnSignals& operator=(const StopOnSignals&) = delete;
};

/// Makes a file that grows beyond the limit of `ulimit -f` an error of writing, EFBIG. By default the signal
/// SIGXFSZ ends the process without a message and without removing its temporary files.
void ignoreFileSizeSignal();

}  // namespace curvisplat
