// The order of a grid's files where it is not known which one is the grid: chosen in a dialog, or dropped.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

namespace curvisplat {

/// For files that do not open as given: with another of them first, which opens as a grid with the rest as its solutions;
/// nullopt if there is none, or if there are more than eight. Opens files, which can take long.
std::optional<std::vector<std::filesystem::path>> gridFirst(std::vector<std::filesystem::path> files);

}  // namespace curvisplat
