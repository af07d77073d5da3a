// Sets up what every long command has around its work: a progress bar (percentage, remaining time and rate),
// signals that stop the work in order, and the trace of --trace FILE. For the main thread; a Progress calls
// its display on any thread.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "stream/base/progress.h"

namespace curvisplat {

/// A display that draws to standard error; empty if standard error is not a terminal.
Progress::Display progressBar();

/// The first SIGINT, SIGTERM or SIGHUP asks the running job to stop, a second one ends the process. During
/// the lifetime of this object these signals, unless they were ignored, call progress.stop(). A signal
/// between two jobs stops the next one. A signal after the last job changes nothing, not even the exit
/// status: its files are complete. At most one instance at a time, on the main thread.
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

/// Runs a command and traces it into the file `path` (--trace FILE), whose format stream/base/trace.h describes, unless it is
/// empty. `others`: the files and caches that the command reads and writes. Throws Error if the trace cannot be written
/// whole or is one of them, and what the command throws: of a command that fails what was traced until then stays,
/// but after a UsageError no file.
void runTraced(const std::filesystem::path& path, const std::vector<std::filesystem::path>& others,
               const std::function<void()>& command);

}  // namespace curvisplat
