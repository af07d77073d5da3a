// Scalars that a cache lacks and the files that it was made from have: which ones, and how one gets into the cache.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stream/base/progress.h"

namespace curvisplat {

struct FurtherScalar {
  std::string name, unit;
  bool derived = false;  // computed from others
};

/// The scalars that `files` have and `cache` lacks, of the same centring, in the order of the files; of a
/// series, those of its first step. Opens the files. Throws Error if they cannot be opened.
std::vector<FurtherScalar> furtherScalarsOf(const std::filesystem::path& cache,
                                            const std::vector<std::filesystem::path>& files);

/// Adds the scalar to the cache; a series is converted again for that, and so is a cache of which some samples have no value of it: the
/// scalar is then kept apart (Manifest::own_blanks). Throws Error as furtherScalarsOf() and addScalars()
/// do, Interrupted once `progress` is stopped; then the cache is as it was.
void addFurtherScalar(const std::filesystem::path& cache, const std::vector<std::filesystem::path>& files,
                      const std::string& name, Progress& progress);

/// Adds those of `names` that the cache lacks and the files have; passes over empty names and others. Throws Error for one
/// of the other centring. Not while another process adds to the cache: keptCacheOf() has its lock.
void addMissingScalars(const std::filesystem::path& cache, const std::vector<std::filesystem::path>& files,
                       const std::vector<std::string>& names, Progress& progress);

}  // namespace curvisplat
