// Follows the files of a running simulation (`convert --follow`): WrittenFiles finds the steps that have
// been written and are not converted yet. Each look lists the folders. One thread at a time may use an object.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/open/series_files.h"
#include "stream/base/progress.h"
#include "stream/base/watched_file.h"

namespace curvisplat {

/// The folders that the grid, the solutions and their patterns are in, each once.
std::vector<std::filesystem::path> foldersOf(const OpenGridOptions& options);

/// The steps of a simulation that are complete on disk: none of a step's files has changed for two seconds of this
/// machine's clock. Times of files are those of another clock (a file server's, or the one of a copy), and only
/// compared with one another.
class WrittenFiles {
 public:
  /// `options`, whose patterns are expanded at each look, outlive it.
  explicit WrittenFiles(const OpenGridOptions& options) : options_(options) {}

  /// next() does not return steps of these files. With `but_the_last` it returns the last one again: its
  /// file may hold several steps, of which only some are done.
  void markDone(const std::vector<std::string>& files, bool but_the_last);

  /// The next step, in order, whose files are all written; nullopt if there is none yet.
  std::optional<StepFiles> next();
  /// Whether next() knew of no step behind the one that it returned.
  bool isLast() const { return is_last_; }
  /// The step that next() returned could not be read, and may be incomplete: a program can pause for longer than two seconds while it
  /// writes. next() returns it again once its files have changed and settled, or the step behind it is written.
  void tryAgain(const StepFiles& step);
  /// How long to wait at most after nullopt before looking again, unless a file changes.
  std::chrono::milliseconds untilNext() const { return until_next_; }
  /// Why files that have a name cannot be looked at, such as links to nothing: next() waits for them. Each is returned once.
  std::vector<std::string> takeReasons() { return std::exchange(reasons_, {}); }

 private:
  struct Seen {
    FileState state;
    std::filesystem::file_time_type written;  // also of a folder, such as a Zarr store
    std::chrono::steady_clock::time_point since;
  };
  struct Failed {
    std::string step;
    std::chrono::steady_clock::time_point at;
  };
  /// The time until no file of the step has changed for a while, as far as it was watched; 0 or less where
  /// that is so.
  std::chrono::milliseconds untilSettled(const StepFiles& step);
  /// Whether the step has failed, and none of its files was seen to change since.
  bool hasFailedAsItIs(const StepFiles& step) const;

  const OpenGridOptions& options_;
  std::map<std::filesystem::path, Seen> seen_;
  std::set<std::string> told_;  // that were among the reasons
  std::vector<std::string> reasons_;
  std::set<std::string> done_;   // names of steps
  bool begins_at_last_ = false;  // of those that are done
  bool is_last_ = false;
  std::optional<Failed> failed_;
  std::chrono::milliseconds until_next_{0};
};

}  // namespace curvisplat
