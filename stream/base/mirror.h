// Folders whose files come from elsewhere, such as a web server, block by block, as they are read.
//
// A Mirror makes a local folder look like the one that its source has: opening a file there for reading makes
// an empty file of the right size, and a read first fetches those blocks of it that are missing. The calls of
// SystemCalls (file.h) ask for that; reads that bypass them must not be of mirrored files (isMirrored).
//
//   open, pread, close of SystemCalls --> mirrors::  --> Mirror --> Fetch
//                                                          |
//                                                          v
//                                             sparse files in the folder
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace curvisplat {

/// The answer of a source.
struct Fetched {
  int error = 0;                 // errno: nothing was sent
  uint64_t file_bytes = 0;       // size of the whole file
  std::vector<std::byte> bytes;  // fewer than asked for only at the file's end
};

/// Asks for `count` bytes of the file `name` at an offset. Several threads call it at once.
using Fetch = std::function<Fetched(const std::string& name, uint64_t offset, uint64_t count)>;

/// Mirrors what `fetch` has into an existing folder of this process' own, from its construction to its destruction. Files that were
/// opened meanwhile must be closed before.
class Mirror {
 public:
  Mirror(std::filesystem::path folder, Fetch fetch);
  ~Mirror();
  Mirror(const Mirror&) = delete;
  Mirror& operator=(const Mirror&) = delete;

  const std::filesystem::path& folder() const;
  /// Bytes that were fetched so far.
  uint64_t fetchedBytes() const;

 private:
  friend struct MirrorCalls;
  struct State;
  std::shared_ptr<State> state_;
};

/// Whether a path lies in a mirrored folder.
bool isMirrored(const std::filesystem::path& path);
/// Makes a folder of a mirrored folder, which may be there or not; without effect on other paths. Its files say whether it is.
void expectMirroredFolder(const std::filesystem::path& path);
/// Makes a file known that may be there or not, for those who look for it before they open it; without effect on other paths.
void expectMirroredFile(const std::filesystem::path& path);

/// SystemCalls calls these functions for every file that it opens, reads and closes.
struct MirrorCalls {
  /// Called before a file is opened. Returns 0 or errno.
  static int prepare(const char* path, int flags);
  static void opened(int fd, const char* path, int flags);
  /// Called before bytes are read. Returns 0 or errno.
  static int read(int fd, uint64_t offset, size_t count);
  static void closed(int fd);
  static bool has(const std::filesystem::path& path);
};

}  // namespace curvisplat
