// Keeps two programs from changing one cache at a time. The lock is on the manifest: it needs no file of its
// own, goes with the process however that ends, and does not disturb readers.
#pragma once

#include <filesystem>

namespace curvisplat {

class CacheLock {
 public:
  /// Throws Error if `cache` has no manifest that can be opened for writing, or if another program has it
  /// locked.
  explicit CacheLock(const std::filesystem::path& cache);
  ~CacheLock();
  CacheLock(const CacheLock&) = delete;
  CacheLock& operator=(const CacheLock&) = delete;

  const std::filesystem::path& cache() const { return cache_; }

  /// False if what is locked is no longer the manifest of the cache: it was replaced meanwhile.
  bool isStillThere() const;

 private:
  std::filesystem::path cache_, manifest_;
  int fd_ = -1;
};

}  // namespace curvisplat
