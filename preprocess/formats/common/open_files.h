// Input files that are opened when they are read, and at most so many at once: a partitioned data set has
// more pieces than a process may have open files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <list>
#include <memory>
#include <mutex>
#include <span>

#include "stream/base/file.h"

namespace curvisplat {

/// The files that are open, the last used first. Any number of threads may ask at once.
class OpenFiles {
 public:
  explicit OpenFiles(size_t most = 64) : most_(most) {}

  /// Opens `path` if it is not open. It stays open for whoever holds it. Throws Error as InputFile does.
  std::shared_ptr<const InputFile> at(const std::filesystem::path& path);

 private:
  const size_t most_;
  std::mutex mutex_;  // guards files_
  std::list<std::shared_ptr<const InputFile>> files_;
};

/// A file of a pool. Any number of threads may read at once.
class PooledFile {
 public:
  /// Throws Error if it cannot be opened.
  PooledFile(std::shared_ptr<OpenFiles> pool, std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  /// For errors.
  std::string name() const { return path_.string(); }
  /// Bytes, when it was opened first.
  uint64_t size() const { return size_; }
  /// Fills `to` from `offset`. Throws Error if the file ends before that, or the disk fails.
  void readAt(uint64_t offset, std::span<std::byte> to) const { pool_->at(path_)->readAt(offset, to); }

 private:
  std::shared_ptr<OpenFiles> pool_;
  std::filesystem::path path_;
  uint64_t size_ = 0;
};

}  // namespace curvisplat
