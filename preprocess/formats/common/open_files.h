// A bounded pool of open input files: a partitioned data set may have more pieces than a process may have
// open files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <list>
#include <memory>
#include <span>

#include "stream/base/file.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// The open files, most recently used first. Thread-safe.
class OpenFiles {
 public:
  explicit OpenFiles(size_t most = 64) : most_(most) {}

  /// Opens `path` unless it is open. It stays open while anybody holds the result. Throws Error as InputFile
  /// does.
  std::shared_ptr<const InputFile> at(const std::filesystem::path& path);

 private:
  const size_t most_;
  Mutex mutex_;
  std::list<std::shared_ptr<const InputFile>> files_ GUARDED_BY(mutex_);
};

/// A file of a pool. Any number of threads may read concurrently.
class PooledFile {
 public:
  /// Throws Error if it cannot be opened.
  PooledFile(std::shared_ptr<OpenFiles> pool, std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  /// For error messages.
  std::string name() const { return path_.string(); }
  /// Its size in bytes when it was first opened.
  uint64_t size() const { return size_; }
  /// Fills `to` with the bytes at `offset`. Throws Error if the file ends before that, or if reading fails.
  void readAt(uint64_t offset, std::span<std::byte> to) const { pool_->at(path_)->readAt(offset, to); }

 private:
  std::shared_ptr<OpenFiles> pool_;
  std::filesystem::path path_;
  uint64_t size_ = 0;
};

}  // namespace curvisplat
