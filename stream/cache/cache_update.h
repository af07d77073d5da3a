// Changes a complete cache: one program at a time, and the manifest last.
//
// A program holds a CacheLock, writes further files beside those of the cache, and then replaces the
// manifest in one step by one that lists them. So readers see the old cache or the new one at every moment.
// The lock (flock) is on the manifest: it needs no file of its own, ends with the process, and does not
// affect readers. One thread at a time.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stream/cache/manifest.h"

namespace curvisplat {

/// The right to change a cache, until the object is destroyed.
class CacheLock {
 public:
  /// Throws Error if `cache` has no manifest that can be opened for writing, if it is one of
  /// Manifest::own_blanks, whose checksum the whole cache has, or if another program holds the lock. Removes
  /// the old manifest if a program was killed just after it had put a new one in its place.
  explicit CacheLock(const std::filesystem::path& cache);
  /// Locks a set of Manifest::own_blanks of a cache that is locked.
  CacheLock(const CacheLock& whole, size_t set);
  ~CacheLock();
  CacheLock(const CacheLock&) = delete;
  CacheLock& operator=(const CacheLock&) = delete;

  const std::filesystem::path& cache() const { return cache_; }

  /// Whether the locked file is still the cache's manifest; false if the cache has been replaced since.
  bool isStillThere() const;
  /// Throws Error unless isStillThere().
  void requireStillThere() const;

 private:
  void lock();

  std::filesystem::path cache_, manifest_;
  int fd_ = -1;
};

/// Replaces the manifest of a cache in one step. After an Error the manifest is what it was; after
/// NameNotSynced (stream/base/durable_file.h) it is the new one, though a power loss may undo that.
void replaceManifest(const std::filesystem::path& cache, const Manifest& manifest);

/// Removes the temporary manifest of a program that was killed while it replaced the manifest, but not that
/// of one that still runs. The caller has locked the cache.
void removeReplacedManifest(const std::filesystem::path& cache);

/// Adds to the manifest those `sources` that it does not list yet.
void addSources(const std::vector<std::string>& sources, Manifest& manifest);

}  // namespace curvisplat
