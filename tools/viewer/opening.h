// Makes a cache of a grid's files on a thread of its own, at low priority, while the window goes on.
#pragma once

#include <filesystem>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/progress.h"
#include "tools/viewer/viewer_options.h"

namespace curvisplat {

class Opening {
 public:
  /// Begins. Calls `wake` when something has changed.
  Opening(std::vector<std::filesystem::path> files, const ViewerOptions& options, void (*wake)());
  /// Stops the conversion.
  ~Opening();
  Opening(const Opening&) = delete;
  Opening& operator=(const Opening&) = delete;

  const std::vector<std::filesystem::path>& files() const { return files_; }
  /// What is being done: "sorting splats"; and which part of it is done, 0 if that is not known.
  std::string phase() const;
  float part() const;
  /// Warnings and notes since the last call.
  std::vector<std::string> takeMessages();
  bool isDone() const;
  /// The cache, once. Throws Error as converting does. Only if isDone().
  std::filesystem::path take() { return cache_.get(); }

 private:
  const std::vector<std::filesystem::path> files_;
  mutable Mutex mutex_;
  std::string phase_ GUARDED_BY(mutex_);
  float part_ GUARDED_BY(mutex_) = 0;
  std::vector<std::string> messages_ GUARDED_BY(mutex_);
  Progress progress_;
  std::future<std::filesystem::path> cache_;
};

}  // namespace curvisplat
