// A conversion while the window goes on: makes a cache of a grid's files, or adds a scalar to one, on a thread of its own
// at low priority.
#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/progress.h"
#include "tools/viewer/conversion_services.h"

namespace curvisplat {

class Opening {
 public:
  /// Returns the path of the cache.
  using Work = std::function<std::filesystem::path(Progress&, const OpeningEvents&)>;

  /// Begins. `title` is shown: "opening a.xyz". Calls `wake` when something has changed.
  Opening(std::string title, Work work, void (*wake)());
  /// Stops the conversion.
  ~Opening();
  Opening(const Opening&) = delete;
  Opening& operator=(const Opening&) = delete;

  const std::string& title() const { return title_; }
  /// What is being done: "sorting splats"; and which part of it is done, 0 if that is not known.
  std::string phase() const;
  float part() const;
  /// Warnings and notes since the last call.
  std::vector<std::string> takeMessages();
  /// The files in their right order, once, if it was not as given.
  std::vector<std::filesystem::path> takeFiles();
  /// What can be shown already, once.
  std::optional<Preview> takePreview();
  bool isDone() const;
  /// The cache, once. Throws Error as converting does. Only if isDone().
  std::filesystem::path take() { return cache_.get(); }

 private:
  const std::string title_;
  mutable Mutex mutex_;
  std::string phase_ GUARDED_BY(mutex_);
  float part_ GUARDED_BY(mutex_) = 0;
  std::vector<std::string> messages_ GUARDED_BY(mutex_);
  std::vector<std::filesystem::path> files_ GUARDED_BY(mutex_);
  std::optional<Preview> preview_ GUARDED_BY(mutex_);
  Progress progress_;
  std::future<std::filesystem::path> cache_;
};

}  // namespace curvisplat
