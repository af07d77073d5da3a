// The folder in which a cache grows: NAME.partial beside NAME, locked while its conversion lives, renamed to
// NAME when it is whole.
//
//              PartialFolder()          putIntoPlace()
//   (nothing) ----------------> locked ----------------> in place
//    ^                          |    |
//    +----- ~PartialFolder() ---+    +--- leave() and ~PartialFolder(), or killed: the folder stays,
//                                         unlocked; the next PartialFolder() empties it, or keeps it
//                                         to go on from
#pragma once

#include <filesystem>

namespace curvisplat {

/// Throws Error if something stands at `target`, and `overwrite` is false or it is no cache.
void checkReplaceable(const std::filesystem::path& target, bool overwrite);

class PartialFolder {
 public:
  enum class Rest { kRemove, kKeep };

  /// Makes and locks the folder. What an unfinished conversion has left there is removed; or kept, and then
  /// the folder is as after leave(). Throws Error unless checkReplaceable(), or if another conversion to the
  /// same target is running.
  PartialFolder(std::filesystem::path target, bool overwrite, Rest rest = Rest::kRemove);
  /// Removes the folder, unless it has been put into place or is to be left.
  ~PartialFolder();
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Where the folder goes in the end.
  const std::filesystem::path& target() const { return target_; }

  /// Removes all that is in the folder, which the destructor will remove.
  void clear();
  /// Whether the destructor leaves the folder, for a conversion that goes on with it.
  void leave(bool leave = true) { leave_ = leave; }

  /// Renames the folder to the target. An old cache there is swapped out in the same step, then removed;
  /// where the file system cannot swap, it is moved aside first, and is put back if the renaming fails. The
  /// folder's files must have been synced.
  void putIntoPlace();

 private:
  void lock();

  std::filesystem::path target_, path_;
  int lock_ = -1;
  bool leave_ = false;
};

}  // namespace curvisplat
