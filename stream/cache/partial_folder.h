// The folder in which a cache grows: NAME.partial beside NAME, locked while its conversion lives, renamed to
// NAME when it is whole.
//
//              PartialFolder()          putIntoPlace()
//   (nothing) ----------------> locked ----------------> in place
//    ^                          |    |
//    +----- ~PartialFolder() ---+    +--- leave() and ~PartialFolder(), or killed: the folder stays,
//                                         unlocked; the next PartialFolder() empties it, or keeps it
//                                         to go on from
//
// The lock file contains kPartialMark. Only folders with this mark (or without any files) are taken over and
// emptied, so that other people's files are never removed.
#pragma once

#include <filesystem>
#include <string_view>

namespace curvisplat {

inline constexpr const char* kPartialLock = "lock";
inline constexpr std::string_view kPartialMark = "curvisplat: unfinished cache\n";

/// Throws Error if something stands at `target`, and `overwrite` is false or it is no cache.
void checkReplaceable(const std::filesystem::path& target, bool overwrite);

/// Whether a conversion to `target` is under way, or was interrupted.
bool hasUnfinished(const std::filesystem::path& target);

class PartialFolder {
 public:
  enum class Rest { kRemove, kKeep };

  /// Makes and locks the folder. What an unfinished conversion has left there is removed; or kept, and then
  /// the folder is as after leave(). Throws Error unless checkReplaceable(), if another conversion to the
  /// same target is running, or if a link or a folder that no conversion has made has the name.
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

  /// Renames the folder to the target, for good: the names are synced. An old cache there is swapped out in
  /// the same step; where the file system cannot swap, it is moved aside first. If that fails, both are where
  /// they were, and this throws Error. The folder's files must have been synced.
  void putIntoPlace();
  /// Whether putIntoPlace() has done so.
  bool isInPlace() const { return lock_ < 0; }
  /// Removes the old cache that putIntoPlace() has swapped out, if there was one. Throws Error.
  void removeReplaced();

 private:
  void lock();
  void mark();

  std::filesystem::path target_, path_;
  std::filesystem::path replaced_;  // where the old cache is; empty: there is none
  int lock_ = -1;
  bool leave_ = false;
};

}  // namespace curvisplat
