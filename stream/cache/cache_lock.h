// Prevents two programs from changing one cache at the same time. The lock (flock) is on the manifest, so it
// needs no file of its own, ends with the process, and does not affect readers.
#pragma once

#include <filesystem>

namespace curvisplat {

class CacheLock {
 public:
  /// Throws Error if `cache` has no manifest that can be opened for writing, or if another program holds the
  /// lock. Removes the old manifest that a program left which was killed just after it had put a new one in place.
  explicit CacheLock(const std::filesystem::path& cache);
  ~CacheLock();
  CacheLock(const CacheLock&) = delete;
  CacheLock& operator=(const CacheLock&) = delete;

  const std::filesystem::path& cache() const { return cache_; }

  /// Whether the locked file is still the cache's manifest; false if the cache has been replaced since.
  bool isStillThere() const;
  /// Throws Error unless it is.
  void requireStillThere() const;

 private:
  std::filesystem::path cache_, manifest_;
  int fd_ = -1;
};

}  // namespace curvisplat
