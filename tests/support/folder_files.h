// All files of a folder, by name, as bytes: to compare two folders, or one with what it was.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace curvisplat {

using Files = std::map<std::string, std::string>;

/// Of the folder itself, not of folders in it.
Files filesOf(const std::filesystem::path& folder);

/// That each file of `expected` is among `files`, with the same bytes. There may be others.
bool holdsAllOf(const Files& files, const Files& expected);

/// Replaces what is in `folder`, which is made if there is none.
void writeFiles(const std::filesystem::path& folder, const Files& files);

}  // namespace curvisplat
