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
// emptied, and what a user has put into a cache outlives the cache's replacement, so that other people's files
// are never removed.
//
// A log in the folder (BrickLog) records the bricks that have been appended to the cache's files, so that an
// interrupted conversion can continue. Both classes are for one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>
#include <system_error>
#include <vector>

#include "stream/base/file.h"
#include "stream/model/octree.h"

namespace curvisplat {

inline constexpr const char* kPartialSuffix = ".partial";  // of the folder's name
inline constexpr const char* kPartialLock = "lock";
inline constexpr std::string_view kPartialMark = "curvisplat: unfinished cache\n";

/// Throws Error if `target` exists, unless it is a cache that this user may remove and `overwrite` is true.
void checkReplaceable(const std::filesystem::path& target, bool overwrite);

/// Whether it is a file that has one of the names which the program gives to files of caches.
bool isCacheFile(const std::filesystem::directory_entry& entry);

/// The names in a cache's folder, and in its folders of geometries, that are not the program's: what a user has
/// put there. Relative to `cache`, sorted.
std::vector<std::filesystem::path> foreignNames(const std::filesystem::path& cache);

/// Removes the files that isCacheFile() from a folder in a cache, and then the folder; does nothing if there is none of this name.
/// What a user has put there stays, and with it the folder: returns why it could not be removed. A link is not followed, and stays.
std::error_code removeCacheFolder(const std::filesystem::path& folder) noexcept;
/// The same; throws OutputError where a part of the folder stays, since the program is about to make one of this name.
void requireCacheFolderRemoved(const std::filesystem::path& folder);

/// Whether a conversion to `target` is running or was interrupted.
bool hasUnfinished(const std::filesystem::path& target);

/// The folder of an unfinished cache; the states are drawn above.
class PartialFolder {
 public:
  enum class Rest { kRemove, kKeep };

  /// Creates and locks the folder. `rest`: remove the files of an unfinished conversion, or keep them, which
  /// implies leave() if the folder exists. Throws Error as checkReplaceable(), if another conversion to
  /// `target` is running, and if the folder's name is that of a link or of a folder that no conversion has
  /// made.
  PartialFolder(std::filesystem::path target, bool overwrite, Rest rest = Rest::kRemove);
  /// Removes the folder, unless putIntoPlace() or leave() was called.
  ~PartialFolder();
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// The final name of the folder.
  const std::filesystem::path& target() const { return target_; }

  /// Removes the folder's contents, and undoes leave(). If a killed run has replaced an old cache, what
  /// foreignNames() finds in the old one is moved into the new one.
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
  /// Removes the old cache that putIntoPlace() has replaced, if there was one; what foreignNames() finds in it
  /// is moved into the new one. Throws Error.
  void removeReplaced();

 private:
  void lock(bool is_new);
  void mark();

  std::filesystem::path target_, path_;
  std::filesystem::path replaced_;  // path of the old cache; empty if there is none
  int lock_ = -1;
  bool leave_ = false;
};

inline constexpr const char* kBrickLogName = "bricks.log";

/// A brick, without links to parent and children, and the extents of its streams.
struct AppendedBrick {
  Brick brick;
  double weight = 0;  // EncodedBrick::weight
  std::vector<BrickVariable> variables;
};

/// Calls `use` for each entry of the log in `folder`, until it returns false or an entry is damaged. Does
/// nothing if there is no log. Throws Error if the disk fails.
void forEachLogged(const std::filesystem::path& folder, size_t variables,
                   const std::function<bool(AppendedBrick&&)>& use);

/// The entries of the log in `folder`, up to the first damaged one; empty if there is no log. Throws Error
/// if the disk fails.
std::vector<AppendedBrick> readBrickLog(const std::filesystem::path& folder, size_t variables);

/// The log of the bricks that a CacheWriter has appended. It is in the partial folder beside the streams,
/// and never becomes part of a cache. Appending does not sync: the log ends at the first entry whose
/// checksum is wrong.
///
///   entry:  BrickRecord 144 | weight 8 | VariableRecord 40 x variables | checksum of the bytes before it 8
class BrickLog {
 public:
  /// Opens the log in `folder`; creates it if it does not exist. Throws Error.
  BrickLog(const std::filesystem::path& folder, size_t variables);

  void append(const AppendedBrick& brick);
  void sync() { file_.sync(); }
  /// Syncs and closes the log, so that another machine may read it. Nothing may be appended afterwards.
  void close() { file_.close(); }
  /// Truncates the log to its first `count` entries.
  void keep(uint64_t count);

 private:
  size_t variables_;
  OutputFile file_;
  std::vector<std::byte> entry_;
};

}  // namespace curvisplat
