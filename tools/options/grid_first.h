// The order of a grid's files where it is not known which one is the grid: chosen in a dialog, or dropped.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "stream/base/progress.h"

namespace curvisplat {

/// For files that do not open as given: with another of them first, which opens as a grid with the rest as its solutions;
/// nullopt if there is none, if there are more than eight, or if they do open as given: then it is not their order that is
/// wrong. Opens files, which can take long; throws Interrupted once `progress` is stopped.
std::optional<std::vector<std::filesystem::path>> gridFirst(std::vector<std::filesystem::path> files,
                                                            const Progress& progress);

}  // namespace curvisplat
