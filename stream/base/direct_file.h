// A file that is read past the page cache where the file system allows it: a cache much larger than memory
// would only push out what others need, and the kernel's read-ahead guesses wrong in an octree.
//
// Direct reads begin, end and land at multiples of kPageBytes. What cannot be read so (a file system that
// refuses O_DIRECT, the odd end of a short read) goes through the page cache by the second descriptor.
#pragma once

#include <filesystem>

namespace curvisplat {

/// Immutable: any thread.
class DirectFile {
 public:
  /// Throws Error if `path` cannot be opened. `direct`: try it.
  explicit DirectFile(std::filesystem::path path, bool direct = true);
  ~DirectFile();
  DirectFile(const DirectFile&) = delete;
  DirectFile& operator=(const DirectFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  bool isDirect() const { return direct_fd_ >= 0; }
  /// -1 where the file system refused.
  int directFd() const { return direct_fd_; }
  int bufferedFd() const { return buffered_fd_; }

 private:
  std::filesystem::path path_;
  int direct_fd_ = -1, buffered_fd_ = -1;
};

}  // namespace curvisplat
