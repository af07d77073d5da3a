// Replaces the manifest of a cache in one step.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stream/cache/manifest.h"

namespace curvisplat {

/// After an Error the manifest is what it was; after NameNotSynced (durable_file.h) it is the new one, though a
/// power loss may undo that.
void replaceManifest(const std::filesystem::path& cache, const Manifest& manifest);

/// Removes what a program has left that was killed while it replaced the manifest; not what one that still runs has there. The
/// caller has locked the cache.
void removeReplacedManifest(const std::filesystem::path& cache);

/// Adds those `sources` that the manifest does not list yet.
void addSources(const std::vector<std::string>& sources, Manifest& manifest);

}  // namespace curvisplat
