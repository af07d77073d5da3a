// Files that appear complete or not at all, and are on the disk once they have been reported as written. Any
// number of processes may write the same file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "stream/base/error.h"

namespace curvisplat {

/// A file has its new name, but its folder could not be synced, and the name could not be taken back: a
/// power loss may do that.
class NameNotSynced : public Error {
 public:
  using Error::Error;
};

/// Renames a synced file within its folder, replaces what is at `to`, and syncs the folder. If that fails,
/// puts the names back and throws Error; NameNotSynced where that is impossible.
void renameDurably(const std::filesystem::path& from, const std::filesystem::path& to);

/// A new, empty file beside `target`, which it is to replace: ".curvisplat.<16 hexadecimal digits>.part".
/// Locked during this object's lifetime, so that removeAbandonedFiles() of other processes leaves it alone.
class TemporaryFile {
 public:
  /// `target` must not be a link. Throws Error that names `target`.
  explicit TemporaryFile(std::filesystem::path target);
  /// Removes the file unless putIntoPlace() has succeeded.
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& target() const { return target_; }
  /// Syncs the file, whoever has written it, and gives it the name of the target. Throws as renameDurably().
  void putIntoPlace();
  /// The text of an error with the target's name instead of this file's, which the user has never heard of.
  std::string aboutTarget(std::string message) const;

 private:
  std::filesystem::path target_, path_;
  int fd_ = -1;
  bool in_place_ = false;
};

/// Writes a whole file. Follows links. Throws Error, also if `path` exists and is not a regular file.
void writeFileDurably(const std::filesystem::path& path, std::span<const std::byte> bytes);
void writeFileDurably(const std::filesystem::path& path, const std::string& text);

/// Removes the TemporaryFiles in `folder` that processes of this machine have left when they were killed.
void removeAbandonedFiles(const std::filesystem::path& folder) noexcept;

}  // namespace curvisplat
