// The folder in which a cache is written: NAME.partial beside NAME. It is locked while its conversion runs,
// and renamed to NAME when the cache is complete.
//
//              PartialFolder()          putIntoPlace()
//   (nothing) ----------------> locked ----------------> in place
//    ^                          |    |
//    +----- ~PartialFolder() ---+    +--- leave() and ~PartialFolder(), or the process is killed: the
//                                         folder remains, unlocked. The next PartialFolder() empties it, or
//                                         keeps its contents to continue the conversion.
//
// The lock file contains kPartialMark. Only folders with this mark, or without any files, are taken over and
// emptied, so that other people's files are never removed.
#pragma once

#include <filesystem>
#include <string_view>

namespace curvisplat {

inline constexpr const char* kPartialSuffix = ".partial";  // of the folder's name
inline constexpr const char* kPartialLock = "lock";
inline constexpr std::string_view kPartialMark = "curvisplat: unfinished cache\n";

/// Throws Error if `target` exists, unless it is a cache and `overwrite` is true.
void checkReplaceable(const std::filesystem::path& target, bool overwrite);

/// Whether a conversion to `target` is running or was interrupted.
bool hasUnfinished(const std::filesystem::path& target);

class PartialFolder {
 public:
  enum class Rest { kRemove, kKeep };

  /// Creates and locks the folder. `rest`: remove the files of an unfinished conversion, or keep them, which
  /// implies leave() where there are any. Throws Error as checkReplaceable(), if another conversion to `target` is running, and if
  /// the folder's name is a link or a folder that no conversion has made.
  PartialFolder(std::filesystem::path target, bool overwrite, Rest rest = Rest::kRemove);
  /// Removes the folder, unless putIntoPlace() or leave() was called.
  ~PartialFolder();
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// The final name of the folder.
  const std::filesystem::path& target() const { return target_; }

  /// Removes the folder's contents, and undoes leave().
  void clear();
  /// Sets whether the destructor leaves the folder for a later conversion to continue.
  void leave(bool leave = true) { leave_ = leave; }

  /// Renames the folder to the target and syncs the names, so that the cache survives a power loss. An old
  /// cache at the target is exchanged with the folder in one step; if the file system cannot exchange names,
  /// it is moved aside first. Throws Error on failure, after moving both back. The folder's files must have
  /// been synced before.
  void putIntoPlace();
  /// Whether putIntoPlace() has succeeded.
  bool isInPlace() const { return lock_ < 0; }
  /// Removes the old cache that putIntoPlace() has replaced, if there was one. Throws Error.
  void removeReplaced();

 private:
  void lock(bool is_new);
  void mark();

  std::filesystem::path target_, path_;
  std::filesystem::path replaced_;  // path of the old cache; empty if there is none
  int lock_ = -1;
  bool leave_ = false;
};

}  // namespace curvisplat
