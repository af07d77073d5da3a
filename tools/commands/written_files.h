// The files of a running simulation: which steps have been written and are not converted.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "preprocess/formats/open/series_files.h"

namespace curvisplat {

/// The folders that the grid, the solutions and their patterns are in, each once.
std::vector<std::filesystem::path> foldersOf(const OpenGridOptions& options);

class WrittenFiles {
 public:
  /// `options`, whose patterns are expanded at each look, outlive it.
  explicit WrittenFiles(const OpenGridOptions& options) : options_(options) {}

  /// Steps of these files are not returned. With `but_the_last` the last step is: its file may hold several, and be done in
  /// part.
  void markDone(const std::vector<std::string>& files, bool but_the_last);

  /// The next step whose files are all written: none has changed for two seconds. nullopt if there is none yet.
  /// Steps come in their order.
  std::optional<StepFiles> next();
  /// After nullopt: how long to wait at most before looking again, unless a file changes.
  std::chrono::milliseconds untilNext() const { return until_next_; }

 private:
  const OpenGridOptions& options_;
  std::set<std::string> done_;   // names of steps
  bool begins_at_last_ = false;  // of those that are done
  std::chrono::milliseconds until_next_{0};
};

}  // namespace curvisplat
