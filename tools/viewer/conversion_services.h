// What the window asks of conversion, which is no part of it: the subcommand supplies these functions. All run on threads
// of their own and throw Error; those with a Progress throw Interrupted once it is stopped.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

struct PreparedView;

/// A coarse cache that is shown while the whole one is made.
struct Preview {
  std::filesystem::path cache, whole;
  std::string what;                                    // "every 4th index plane"
  std::shared_ptr<const void> folder;                  // what keeps `cache` there while this is held
  std::shared_ptr<const PreparedView> view = nullptr;  // for the first time it is shown
};

/// Whom a conversion tells what it has.
struct OpeningEvents {
  std::function<void(const std::string&)> say;
  std::function<void(Preview)> preview;
  /// The files, the grid first: they were given in another order, as a desktop drops them or a dialog sorts them.
  std::function<void(const std::vector<std::filesystem::path>&)> reorder;
};

/// A scalar of a cache's sources that the cache lacks.
struct SourceScalar {
  std::string name, unit;
  bool derived = false;  // computed from others
};

struct ConversionServices {
  using Paths = std::vector<std::filesystem::path>;
  /// Makes a cache of files that are none; returns its path, or that of a cache itself.
  std::function<std::filesystem::path(const Paths& files, Progress& progress, const OpeningEvents& events)>
      to_cache;
  /// The files that a cache was made from, as far as they are there; empty if one is missing. Fast: for the main thread.
  std::function<Paths(const Manifest& manifest, const std::filesystem::path& cache)> sources_of;
  std::function<std::vector<SourceScalar>(const std::filesystem::path& cache, const Paths& files)>
      further_scalars;
  std::function<void(const std::filesystem::path& cache, const Paths& files, const std::string& scalar,
                     Progress& progress)>
      add_scalar;
};

}  // namespace curvisplat
