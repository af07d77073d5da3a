// A file that a library reads by its name while others may write it. HDF5 and NetCDF take zeros for what lies beyond the end of a file
// that was cut after it had been opened, and say nothing.
#pragma once

#include <cstdint>
#include <filesystem>

namespace curvisplat {

/// What a file was when a library opened it. Any thread may ask.
class WatchedFile {
 public:
  /// As it is now; a file that is not there never changes.
  explicit WatchedFile(std::filesystem::path path);

  /// Whether the name has a file of the same length and the same time of change.
  bool isSame() const;
  /// Throws Error if the file has become shorter since, or was written again with the same length. One that grows may be that of a
  /// running program, whose earlier steps stay; one whose name has gone, or was given to another, is read to its end as it was.
  void requireWhole() const;
  /// Throws Error as requireWhole() does.
  [[noreturn]] void failAsChanged() const;

 private:
  struct State {
    uint64_t device = 0, number = 0, bytes = 0;
    int64_t changed_ns = 0;

    bool operator==(const State& other) const = default;
  };
  static State stateOf(const std::filesystem::path& path);

  std::filesystem::path path_;
  State opened_;
};

}  // namespace curvisplat
