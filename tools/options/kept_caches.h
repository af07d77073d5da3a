// Caches of grids that were opened without `convert`: kept in the user's cache folder, $XDG_CACHE_HOME/curvisplat or
// ~/.cache/curvisplat, and found again by the contents of the grid's files, wherever these lie.
//
//   <folder>/<key>/NAME.splats      NAME: of the grid's file; one for each --value-precision
//   <folder>/<key>/preview.*        a coarse cache, while the other is made and until the window has left it
//   <folder>/<key>/series.*         the cache of a series, to which NAME.splats links once it is complete
//   <folder>/<key>/used             its time: when it was opened last; locked while it is made
//   <folder>/<key>/changed          the files changed meanwhile: the cache is made again by the next who opens them
//   <folder>/known/<file>           checksum of a file that has not changed since, by its path, and the files that it links to (HDF5)
//
// When they take more than the limit (CURVISPLAT_CACHE_SIZE, default 20G), those that were not used for longest are
// removed. Readers that have one open keep what they have read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "tools/options/kept_conversion.h"

namespace curvisplat {

/// The cache folder; nullopt if neither XDG_CACHE_HOME nor HOME is set.
std::optional<std::filesystem::path> keptFolder();

/// Whether these are the files of a grid, not a cache: a regular file, a folder of a grid, or a pattern of files.
bool isGrid(const std::vector<std::filesystem::path>& files);

/// The cache of a grid's files, or of a series' (q.0 q.1 ...): the one that is kept, or a new one, made with all default
/// options of `convert` but the precision. Those of `scalars` that it lacks and the files have are added; empty names and
/// others are passed over. Processes that want the same one wait for each other. Throws Error as opening and converting do, Interrupted
/// once `progress` is stopped.
std::filesystem::path keptCacheOf(const std::vector<std::filesystem::path>& files, Progress& progress,
                                  const KeptCacheEvents& events, const std::vector<std::string>& scalars = {},
                                  ValuePrecision precision = ValuePrecision::kAuto);

/// Removes the caches in `folder` that were not used for longest, until the rest takes `limit` bytes at most. Keeps
/// `kept`, and those that are being made.
void limitKeptCaches(const std::filesystem::path& folder, uint64_t limit, const std::filesystem::path& kept);

/// The name of the files in messages and menus: their names without folders.
std::string namesOf(const std::vector<std::filesystem::path>& files);

}  // namespace curvisplat
