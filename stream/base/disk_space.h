// The free space on a disk: how much there is, and the error where there is none.
//
// A failed write is a DiskFull if the disk is full, a quota is used up, or the limit of file sizes is
// reached. It may name a temporary file that the user has never heard of. Whoever knows which folders the
// user gave (RoomNeeded) catches it and throws an OutputError that names one of them. Any thread may call
// all of this.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {

/// The bytes that a user may still write to the file system of `folder`; nullopt if that is not known, since
/// some file systems (ramfs, some on FUSE or a network) say that they have no blocks at all.
std::optional<uint64_t> freeBytes(const std::filesystem::path& folder) noexcept;

/// There is no space for a file or a folder, or for its name.
class DiskFull : public OutputError {
 public:
  /// Whether `error`, a value of errno, says that there is no space.
  static bool is(int error);

  /// `file`: the file or folder that there is no space for. `shown`: what the message names instead of it.
  /// `what`: what needs the space.
  DiskFull(std::filesystem::path file, const std::filesystem::path& shown, const std::string& what,
           int error);

  const std::filesystem::path& file() const { return file_; }
  /// The system's text for the error.
  std::string reason() const;
  /// Advice for the user: `of_full_disk`, unless the limit of file sizes was reached.
  std::string advice(const std::string& of_full_disk) const;

 private:
  std::filesystem::path file_;
  int error_;
};

/// Throws the error for a file or folder `from` that could not be renamed to `to`: DiskFull if there is no
/// space for the name, otherwise an OutputError. `error`: a value of errno.
[[noreturn]] void failToRename(int error, const std::filesystem::path& from, const std::filesystem::path& to);

/// The space that some work needs, and the folders that the user gave for it.
struct RoomNeeded {
  std::vector<std::filesystem::path> folders;
  std::string what;    // "the cache and its temporary files"
  std::string advice;  // what helps where a disk is full

  /// The error for the user. It names the innermost of the folders that the file is in; if the file is in
  /// none of them, the message is that of `full`.
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
