// A conversion while the window goes on: makes a cache of a grid's files, or adds a scalar to one, in the background.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/mutex.h"
#include "tools/viewer/background_job.h"
#include "tools/viewer/conversion_services.h"

namespace curvisplat {

class Opening {
 public:
  /// Returns the path of the cache.
  using Work = std::function<std::filesystem::path(Progress&, const OpeningEvents&)>;

  /// Begins. `title` is shown: "opening a.xyz". Calls `wake` when something has changed. The destructor stops it.
  Opening(std::string title, Work work, void (*wake)());

  const BackgroundJob& job() const { return job_; }
  /// Warnings and notes since the last call.
  std::vector<std::string> takeMessages();
  /// The files in their right order, once, if it was not as given.
  std::vector<std::filesystem::path> takeFiles();
  /// What can be shown already, once.
  std::optional<Preview> takePreview();
  bool isDone() const { return job_.isDone(); }
  /// The cache, once. Throws Error as converting does. Only if isDone().
  std::filesystem::path take() { return job_.take(); }

 private:
  Mutex mutex_;
  std::vector<std::string> messages_ GUARDED_BY(mutex_);
  std::vector<std::filesystem::path> files_ GUARDED_BY(mutex_);
  std::optional<Preview> preview_ GUARDED_BY(mutex_);
  BackgroundJob job_;  // last: its thread uses the others
};

}  // namespace curvisplat
