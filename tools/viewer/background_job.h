// A job beside the window, on threads of low priority: its progress, and the file that it makes.
#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <string>

#include "stream/base/mutex.h"
#include "stream/base/progress.h"

namespace curvisplat {

class BackgroundJob {
 public:
  /// Returns the path of what it made.
  using Work = std::function<std::filesystem::path(Progress&)>;

  /// Begins. `title` is shown: "opening a.xyz"; `phase`, until `work` begins one. Calls `wake` when something has changed.
  BackgroundJob(std::string title, std::string phase, Work work, void (*wake)());
  /// Stops it, and waits until it has stopped.
  ~BackgroundJob();
  BackgroundJob(const BackgroundJob&) = delete;
  BackgroundJob& operator=(const BackgroundJob&) = delete;

  const std::string& title() const { return title_; }
  /// What is being done: "sorting splats"; and which part of it is done, 0 if that is not known.
  std::string phase() const;
  float part() const;
  bool isDone() const;
  /// The path, once. Throws what the work threw; Interrupted after stopping. Only if isDone().
  std::filesystem::path take() { return made_.get(); }

 private:
  const std::string title_;
  mutable Mutex mutex_;
  std::string phase_ GUARDED_BY(mutex_);
  float part_ GUARDED_BY(mutex_) = 0;
  Progress progress_;
  std::future<std::filesystem::path> made_;
};

}  // namespace curvisplat
