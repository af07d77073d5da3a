// Files of a cache, which may come from anyone.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace curvisplat {

/// The path of a file of the folder `cache`, to be opened. `name` is a plain file name. Throws Error where
/// that is a symbolic link, which may lead out of the folder, or no file, which may wait for ever to be
/// opened.
std::filesystem::path cacheFile(const std::filesystem::path& cache, const std::string& name);

}  // namespace curvisplat
