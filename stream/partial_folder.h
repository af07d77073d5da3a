// The folder in which a cache grows: NAME.partial beside NAME, locked while its conversion lives, renamed to
// NAME when it is whole.
//
//              PartialFolder()          putIntoPlace()
//   (nothing) ----------------> locked ----------------> in place
//    ^                            |
//    +------ ~PartialFolder() ----+        killed: the folder stays, unlocked; the next PartialFolder()
//    empties it
#pragma once

#include <filesystem>

namespace curvisplat {

/// Throws Error if something stands at `target`, and `overwrite` is false or it is no cache.
void checkReplaceable(const std::filesystem::path& target, bool overwrite);

class PartialFolder {
 public:
  /// Makes and locks the folder. Throws Error unless checkReplaceable(), or if another conversion to the same
  /// target is running.
  PartialFolder(std::filesystem::path target, bool overwrite);
  /// Removes the folder, unless it has been put into place.
  ~PartialFolder();
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

  /// Renames the folder to the target. An old cache there is swapped out in the same step, then removed;
  /// where the file system cannot swap, it is moved aside first, and is put back if the renaming fails. The
  /// folder's files must have been synced.
  void putIntoPlace();

 private:
  void lock();

  std::filesystem::path target_, path_;
  int lock_ = -1;
};

}  // namespace curvisplat
