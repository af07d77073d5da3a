// A file that is read while others may write it. HDF5 and NetCDF take zeros for what lies beyond the end of a file that was cut after it
// had been opened, and say nothing; a file that is written again in place may be read in part as it was.
#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "stream/base/mutex.h"

namespace curvisplat {

/// Tells whether a file is unchanged, without reading it.
struct FileState {
  uint64_t device = 0, number = 0, bytes = 0;
  int64_t changed_ns = 0;

  bool operator==(const FileState& other) const = default;

  /// Returns zeros for a name without a file, and for a folder, which gets files of further steps.
  static FileState of(const std::filesystem::path& path);
};

/// Keeps what a file was when it was opened. Any thread may ask.
class WatchedFile {
 public:
  /// Notes the file as it is now. One that is not there never changes, nor does a folder.
  explicit WatchedFile(std::filesystem::path path);

  /// Whether the name has a file of the same length and the same time of change.
  bool isSame() const;
  /// Whether the file is not known to have changed: it has neither become shorter, nor was it written again with the same length,
  /// nor was its name given to another one. A file that grows may be that of a running program, whose earlier steps stay; one whose
  /// name has gone is read to its end as it was.
  bool isWhole() const;
  /// Throws Error if the file has become shorter: what lies beyond its end is read as zeros.
  void requireWhole() const;
  /// Throws Error as requireWhole() does.
  [[noreturn]] void failAsChanged() const;
  const std::filesystem::path& path() const { return path_; }

 private:
  bool isOpened(const FileState& now) const;

  std::filesystem::path path_;
  FileState opened_;
};

/// Notes that a file leads to others, for WatchedFiles that are made later. Any thread.
void noteLinks(const std::filesystem::path& from, const std::set<std::filesystem::path>& to);

/// The files that noteLinks() noted for this one. Any thread.
std::set<std::filesystem::path> linkedFilesOf(const std::filesystem::path& from);

/// Guards what noteLinks() notes. Whoever holds it while the process forks finds it free in both processes.
Mutex& linksMutex();

/// Some files, with those that they lead to at any depth (noteLinks()).
class WatchedFiles {
 public:
  explicit WatchedFiles(const std::vector<std::string>& names = {});

  /// Throw Error as WatchedFile::failAsChanged() does for a file that is not the same, or has become shorter.
  void requireSame() const;
  void requireWhole() const;
  /// Adds a warning for each file that is not whole.
  void warn(std::vector<std::string>& warnings) const;

 private:
  std::vector<WatchedFile> files_;
};

}  // namespace curvisplat
