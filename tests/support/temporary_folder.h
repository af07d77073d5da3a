// Folders of a test's own, and files in them. TemporaryFolder makes a folder and removes it, with all in it, at the end
// of the scope; Files are the files of a folder as bytes, to compare two folders, or one with what it was; FolderWatch
// waits, without polling, for something to happen in a folder. It needs the system alone, so that programs without
// GoogleTest use it, too.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace curvisplat {

class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(std::string_view name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// The files of a folder: their bytes by their names.
using Files = std::map<std::string, std::string>;

/// The files in the folder itself, not those in folders below it.
Files filesOf(const std::filesystem::path& folder);

/// The files of the folder and of those below it, by their paths; and these folders, whose paths end in '/'.
Files allFilesOf(const std::filesystem::path& folder);

/// Whether each file of `expected` is among `files`, with the same bytes. There may be others.
bool holdsAllOf(const Files& files, const Files& expected);

/// Replaces what is in `folder`, which is made if there is none.
void writeFiles(const std::filesystem::path& folder, const Files& files);

std::string bytesOfFile(const std::filesystem::path& path);
void overwriteFile(const std::filesystem::path& path, const std::string& bytes);

/// How many files and folders there are in the folder itself.
size_t entriesOf(const std::filesystem::path& folder);

/// Waits for something to happen in a folder (Linux inotify). Watches from its construction on.
class FolderWatch {
 public:
  explicit FolderWatch(const std::filesystem::path& folder);
  ~FolderWatch();
  FolderWatch(const FolderWatch&) = delete;
  FolderWatch& operator=(const FolderWatch&) = delete;

  /// Asks `happened` now, and again after everything that happens in the folder, until it says yes. Throws
  /// std::runtime_error if nothing has happened for a minute.
  void waitUntil(const std::function<bool()>& happened);

 private:
  int fd_ = -1;
};

}  // namespace curvisplat
