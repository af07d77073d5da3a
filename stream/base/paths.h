// What is where a name leads that a person has given.
#pragma once

#include <filesystem>

namespace curvisplat {

/// The folder that holds `path`, "." for a plain name.
std::filesystem::path folderOf(const std::filesystem::path& path);

/// Whether there is a regular file, perhaps at the end of links. A name that cannot be one, such as one that
/// is too long, is none.
bool isRegularFile(const std::filesystem::path& path) noexcept;

/// `path`, or what is at the end of the links that it names, whether that is there or not. Throws Error if
/// they go round.
std::filesystem::path linkTarget(std::filesystem::path path);

/// linkTarget() of a file that is to be written. Throws Error if something else than a regular file is there.
std::filesystem::path writableTarget(const std::filesystem::path& path);

}  // namespace curvisplat
