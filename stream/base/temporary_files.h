// Temporary files and folders that no run leaves behind, however its process ends.
//
// A NamelessFile is removed from its folder as soon as it is open, so that the system frees its space. What
// needs a name (a TemporarySubfolder, a file that is renamed when it is complete:
// stream/base/durable_file.h) is locked while its process lives, and its name says which machine made it:
// the next run on that machine removes what nobody has locked.
//
// Others may be able to write to the folder. So files are created under names that nothing has yet, and a
// file or link that someone put there beforehand is never opened. Any thread may call the functions; errors
// name the folder.
#pragma once

#include <sys/stat.h>
#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "stream/base/file.h"

namespace curvisplat {

/// A file that has just been created. It is empty, and open for reading and writing. Whoever gets it closes
/// `fd`.
struct NewFile {
  std::filesystem::path path;
  int fd = -1;  // -1: no file can be created; errno says why
};

/// Creates a file with the permissions `mode`. `name` gives a path for a random number; it is called again
/// as long as something (even a link) has the name already.
NewFile createNewFile(const std::function<std::filesystem::path(uint32_t random)>& name, unsigned mode);

/// Names of temporary files and folders: `begin`, 8 hexadecimal digits of the machine, 8 random ones, `end`.
/// A later run removes only what this machine made: locks of other machines cannot be relied upon on every
/// file system.
struct TemporaryNames {
  std::string_view begin, end;

  /// A name on this machine.
  std::string of(uint32_t random) const;
  /// Whether a process of this machine has given this name.
  bool areOfThisMachine(std::string_view name) const;
};

/// Locks an open file or folder that has just been made, so that removeAbandoned() in other processes leaves
/// it alone. Returns false if one of them has removed it before. On a file system without locks
/// removeAbandoned() removes nothing.
bool lockNew(int fd);

/// Removes those files and folders from `folder` that have such a name, can be opened with the `flags` of
/// open(2), belong to this program by `is_ours`, and are locked by nobody.
void removeAbandoned(const std::filesystem::path& folder, const TemporaryNames& names, int flags,
                     bool (*is_ours)(const struct stat&)) noexcept;

/// A folder of temporary files that need names, since libraries open them by name. If its process is killed,
/// the next one that makes such a folder in the same place removes it. One thread at a time.
class TemporarySubfolder {
 public:
  /// Makes "curvisplat.<16 hexadecimal digits>`ending`" in `parent`, for this user alone. Removes folders of
  /// the same ending that killed processes of this user on this machine have left there. Throws Error that
  /// names the folder.
  TemporarySubfolder(const std::filesystem::path& parent, std::string_view ending);
  ~TemporarySubfolder() { remove(); }
  TemporarySubfolder(const TemporarySubfolder&) = delete;
  TemporarySubfolder& operator=(const TemporarySubfolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Removes the folder and everything in it, but not in a process that was forked, whose parent has the folder. Files that are open
  /// stay readable.
  void remove() noexcept;

 private:
  std::filesystem::path path_;
  pid_t process_;
  int fd_ = -1;  // locked, so that other processes leave the folder alone; -1: removed
};

/// The folder that NamelessFiles are made in, and the bytes that they take together. Copies share their
/// files. Any thread.
class ScratchFiles {
 public:
  ScratchFiles(std::filesystem::path folder);  // NOLINT(google-explicit-constructor): a folder will do

  const std::filesystem::path& folder() const { return folder_; }
  /// Counts the `bytes` of a file of another kind as well, as long as the returned object lives. `bytes`
  /// must not use these ScratchFiles.
  [[nodiscard]] std::shared_ptr<void> countBeside(std::function<uint64_t()> bytes) const;
  /// The largest number of bytes that all files took together at any moment.
  uint64_t mostBytes() const;

 private:
  friend class NamelessFile;
  struct State;
  std::filesystem::path folder_;
  std::shared_ptr<State> state_;
};

/// A temporary file without a name, for data that does not fit in memory and that nobody else reads. The
/// system frees its space when it is closed. Threads: as OutputFile and InputFile.
class NamelessFile {
 public:
  /// Throws Error if no file can be made there.
  explicit NamelessFile(const ScratchFiles& scratch);
  NamelessFile(const NamelessFile&) = delete;
  NamelessFile& operator=(const NamelessFile&) = delete;

  OutputFile& out() { return out_; }
  /// Reads what has been written. Its size() is 0, from when the file was made.
  const InputFile& in() const { return in_; }

 private:
  OutputFile out_;
  InputFile in_;
  std::shared_ptr<void> counted_;  // last: it uses the file
};

}  // namespace curvisplat
