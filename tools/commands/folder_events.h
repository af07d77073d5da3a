// Waits for what other programs write into folders. One thread at a time may use an object.
#pragma once

#include <chrono>
#include <filesystem>
#include <vector>

#include "stream/base/progress.h"

namespace curvisplat {

/// Waits for files to appear or change in folders, by inotify. Where the system does not report changes
/// (network file systems, too few watches, a build without inotify, a folder that does not exist yet), wait() returns after a quarter
/// of a second.
class FolderEvents {
 public:
  explicit FolderEvents(std::vector<std::filesystem::path> folders);
  ~FolderEvents();
  FolderEvents(const FolderEvents&) = delete;
  FolderEvents& operator=(const FolderEvents&) = delete;

  /// Waits for a change that no earlier call has seen, or for `longest`. It may return without a change.
  /// Throws Interrupted after progress.stop().
  void wait(std::chrono::milliseconds longest, const Progress& progress);

 private:
  void watch();
  void close();

  const std::vector<std::filesystem::path> folders_;
  int queue_ = -1;  // of inotify; -1: look from time to time
};

}  // namespace curvisplat
