// A folder of temporary files that need names, since libraries open them by name. Whatever ends the process, the next one
// that makes such a folder in the same place removes it.
#pragma once

#include <filesystem>
#include <string_view>

namespace curvisplat {

class TemporarySubfolder {
 public:
  /// Makes "curvisplat.<16 hexadecimal digits>`ending`" in `parent`, for this user alone, and removes those of the same ending that
  /// killed processes of this user have left there on this machine. Throws Error that names the folder.
  TemporarySubfolder(const std::filesystem::path& parent, std::string_view ending);
  ~TemporarySubfolder() { remove(); }
  TemporarySubfolder(const TemporarySubfolder&) = delete;
  TemporarySubfolder& operator=(const TemporarySubfolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Removes it with all that is in it. Files that are open stay readable.
  void remove() noexcept;

 private:
  std::filesystem::path path_;
  int fd_ = -1;  // locked, so that other processes leave the folder alone; -1: removed
};

}  // namespace curvisplat
