// A file that is read while others may write it. HDF5 and NetCDF take zeros for what lies beyond the end of a file that was cut after it
// had been opened, and say nothing; a file that is written again in place may be read in part as it was.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace curvisplat {

/// Keeps what a file was when it was opened. Any thread may ask.
class WatchedFile {
 public:
  /// Notes the file as it is now. One that is not there never changes, nor does a folder, which gets files of further steps.
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
  struct State {
    uint64_t device = 0, number = 0, bytes = 0;
    int64_t changed_ns = 0;

    bool operator==(const State& other) const = default;
  };
  static State stateOf(const std::filesystem::path& path);
  bool isOpened(const State& now) const;

  std::filesystem::path path_;
  State opened_;
};

/// The files of a grid that becomes a cache.
class WatchedFiles {
 public:
  explicit WatchedFiles(const std::vector<std::string>& names);
  /// Adds a warning for each file that is not whole.
  void warn(std::vector<std::string>& warnings) const;

 private:
  std::vector<WatchedFile> files_;
};

}  // namespace curvisplat
