// Waits for something to happen in a folder, without polling.
#pragma once

#include <filesystem>
#include <functional>

namespace curvisplat {

/// Watches from its construction on (Linux inotify).
class FolderWatch {
 public:
  explicit FolderWatch(const std::filesystem::path& folder);
  ~FolderWatch();
  FolderWatch(const FolderWatch&) = delete;
  FolderWatch& operator=(const FolderWatch&) = delete;

  /// Asks `happened` now, and again after everything that happens in the folder, until it says yes. Throws
  /// std::runtime_error if nothing has happened for a minute.
  void waitUntil(const std::function<bool()>& happened);

 private:
  int fd_ = -1;
};

}  // namespace curvisplat
