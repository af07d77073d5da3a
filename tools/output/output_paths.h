// Whether there is a place for what a command is to write: asked before the work that it is the result of.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

namespace curvisplat {

/// Throws Error if the folder that `path`, the value of `option`, is to be written to does not exist or
/// cannot be written to.
void checkOutputFolder(std::string_view option, const std::filesystem::path& path);

/// checkOutputFolder() for a file. Throws Error, too, if `path` is there and is no regular file, or if
/// writing it would change one of `others`: files or caches that are read, or written as well.
void checkOutputFile(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others);

}  // namespace curvisplat
