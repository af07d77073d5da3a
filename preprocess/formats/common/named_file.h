// Files that another one names: those of a case, a collection or a series.
#pragma once

#include <filesystem>
#include <string_view>

namespace curvisplat {

/// Returns `path`. Throws Error, "WHO names PATH, which does not exist", unless it is a regular file; `who`: "a.vtm:". Says
/// so where only a compressed file of that name exists.
const std::filesystem::path& existingFile(std::string_view who, const std::filesystem::path& path);

}  // namespace curvisplat
