// Files that are not read: what they are, and what to do with them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace curvisplat {

/// Describes a folder that is not read: "a Zarr store, ..."; nullopt for other folders and for files.
std::optional<std::string> foreignFolder(const std::filesystem::path& folder);

/// Describes an HDF5 file that is none of the formats that are read, by what is in its root: "a MED file, ..."; nullopt for others.
std::optional<std::string> foreignHdf5(const std::filesystem::path& path);

/// Throws Error with the name of the format if `path` is a folder or of a format that is not read here.
/// `expected`: "a grid file".
void refuseForeign(const std::filesystem::path& path, const char* expected);

}  // namespace curvisplat
