// Resolves paths that users supply.
#pragma once

#include <filesystem>
#include <string>

namespace curvisplat {

/// The folder that contains `path`: "." for a plain name.
std::filesystem::path folderOf(const std::filesystem::path& path);

/// ".png" of "a.PNG": the ending of the name, in small letters; empty if there is none.
std::string extensionOf(const std::filesystem::path& path);

/// Whether `path` is a regular file, or links that end at one. False for names that no file can have, such as
/// names that are too long.
bool isRegularFile(const std::filesystem::path& path) noexcept;

/// `path` itself, or the path at the end of its symbolic links, whether that exists or not. Throws Error if
/// the links form a cycle.
std::filesystem::path linkTarget(std::filesystem::path path);

/// linkTarget() for a file to be written. Throws Error if the target exists and is not a regular file.
std::filesystem::path writableTarget(const std::filesystem::path& path);

}  // namespace curvisplat
