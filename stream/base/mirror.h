// Folders whose files come from elsewhere, such as a web server, block by block, as they are read.
//
// A Mirror makes a local folder look like the one that its source has: opening a file there for reading makes
// an empty file of the right size, and a read first fetches those blocks of it that are missing. SystemCalls
// (file.h) has that done; code that bypasses it must not read mirrored files (isMirrored()). Any thread may
// read.
//
//   open, pread, close of SystemCalls --> MirrorCalls --> Mirror --> Fetch
//                                                           |
//                                                           v
//                                              sparse files in the folder
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
  int error = 0;                 // an errno if nothing was sent, else 0
  uint64_t file_bytes = 0;       // size of the whole file
  std::vector<std::byte> bytes;  // fewer than asked for only at the file's end
};

/// Gets `count` bytes at `offset` of the file `name`, a path in the folder. Several threads call it at once.
using Fetch = std::function<Fetched(const std::string& name, uint64_t offset, uint64_t count)>;

/// Mirrors the files that `fetch` gives in `folder`, which exists and belongs to this process alone, as long
/// as the Mirror lives. Files that were opened there must be closed before it is destroyed.
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
/// Makes a folder within a mirrored folder, although the source may lack it: only a read of its files tells.
/// Does nothing with other paths.
void expectMirroredFolder(const std::filesystem::path& path);
/// Makes a file of a mirrored folder visible if the source has it, for callers that look for it before they
/// open it. Does nothing with other paths.
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
