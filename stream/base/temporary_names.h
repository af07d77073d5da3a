// Names by which a later run tells what killed processes of this machine have left from what others work on.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace curvisplat {

/// What stands before and behind the 16 hexadecimal digits.
struct TemporaryNames {
  std::string_view begin, end;

  /// A name on this machine.
  std::string of(uint32_t random) const;
  /// Whether a process of this machine has given this name. Locks of other machines cannot be relied upon on every file system.
  bool areOfThisMachine(std::string_view name) const;
};

/// Locks an open file or folder that has just been made, against removeAbandoned() of other processes. False if one of them has
/// taken it for abandoned before. Where nothing can be locked, removeAbandoned() removes nothing.
bool lockNew(int fd);

/// Removes what in `folder` has such a name, opens with `flags` of open(2), is what `is_ours` returns true for, and is locked by
/// nobody.
void removeAbandoned(const std::filesystem::path& folder, const TemporaryNames& names, int flags,
                     bool (*is_ours)(const struct stat&)) noexcept;

}  // namespace curvisplat
