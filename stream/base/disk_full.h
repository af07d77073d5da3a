// The error of a file for which there is no room: the disk is full, a quota is used up, or a limit of file sizes is reached.
// It names temporary files that the user has never heard of. Whoever knows which folders the user gave reports it under
// one of these (RoomNeeded).
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {

class DiskFull : public OutputError {
 public:
  /// Whether `error`, a value of errno, says that there is no room.
  static bool is(int error);

  /// `file`: where there is no room. `shown`: what the message names instead of it. `what`: needs the room.
  DiskFull(std::filesystem::path file, const std::filesystem::path& shown, const std::string& what,
           int error);

  const std::filesystem::path& file() const { return file_; }
  /// The system's words.
  std::string reason() const;
  /// What helps: `of_full_disk`, unless it was the limit of file sizes.
  std::string advice(const std::string& of_full_disk) const;

 private:
  std::filesystem::path file_;
  int error_;
};

/// Throws the error, a value of errno, of a complete file or folder `from` that could not be renamed to `to`: DiskFull if
/// there is no room for the name.
[[noreturn]] void failToRename(int error, const std::filesystem::path& from, const std::filesystem::path& to);

/// What some work writes, and the folders that the user gave for it.
struct RoomNeeded {
  std::vector<std::filesystem::path> folders;
  std::string what;    // "the cache and its temporary files"
  std::string advice;  // what helps where a disk is full

  /// The error for the user. It names the longest of the folders that the file is in; if it is in none, the message stays.
  OutputError error(const DiskFull& full) const;

  /// Calls `work()` and throws error() instead of DiskFull.
  template <typename Work>
  auto during(const Work& work) const {
    try {
      return work();
    } catch (const DiskFull& full) {
      throw error(full);
    }
  }
};

}  // namespace curvisplat
