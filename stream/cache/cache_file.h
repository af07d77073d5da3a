// Opens a cache's files safely. A cache may come from anyone.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace curvisplat {

/// The path of the file `name` (a plain file name) in the folder `cache`, checked before it is opened. Throws
/// Error if it is a symbolic link, which may lead out of the folder, or exists but is not a regular file:
/// opening a pipe may block forever.
std::filesystem::path cacheFile(const std::filesystem::path& cache, const std::string& name);

/// The same of a folder in the folder `cache`. Throws Error if it is a link, or no folder.
std::filesystem::path cacheFolder(const std::filesystem::path& cache, const std::string& name);

}  // namespace curvisplat
