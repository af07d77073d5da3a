// Checks, before the work begins, that a command can write its outputs.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

namespace curvisplat {

/// `path` is the value of `option`. Throws Error if its folder does not exist or is not writable, or if no file
/// can have the name with `suffix`, which names of temporary files beside it end with.
void checkOutputFolder(std::string_view option, const std::filesystem::path& path,
                       std::string_view suffix = "");

/// Calls checkOutputFolder(), and removes unfinished files that killed runs have left in the folder. Also
/// throws Error if `path` exists and is not a regular file, or if it is one of `others` (files or caches that
/// the command reads or writes) or a file of such a cache.
void checkOutputFile(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others);

}  // namespace curvisplat
