// A file opened for reading with O_DIRECT where the file system allows it. A cache much larger than memory
// would evict everything else from the page cache, and the kernel's read-ahead guesses wrong in an octree.
//
// Direct reads need offsets, lengths and addresses that are multiples of kPageBytes. Reads that cannot be
// direct (the file system refuses O_DIRECT, or a short read ended at an unaligned byte) use the second,
// buffered descriptor.
#pragma once

#include <filesystem>

namespace curvisplat {

/// Immutable: any thread.
class DirectFile {
 public:
  /// `direct`: try O_DIRECT. Throws Error if `path` cannot be opened.
  explicit DirectFile(std::filesystem::path path, bool direct = true);
  ~DirectFile();
  DirectFile(const DirectFile&) = delete;
  DirectFile& operator=(const DirectFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  bool isDirect() const { return direct_fd_ >= 0; }
  /// -1 if the file system refused O_DIRECT.
  int directFd() const { return direct_fd_; }
  int bufferedFd() const { return buffered_fd_; }

 private:
  std::filesystem::path path_;
  int direct_fd_ = -1, buffered_fd_ = -1;
};

}  // namespace curvisplat
