// Reads the names of files: which of them are steps of one series, in which order, and which are pieces of one step.
// series_files.h has the rules.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"

namespace curvisplat {

/// Sorts the files by the numbers in their names, q.9 before q.10, and leaves each once. Points and minus signs belong to the
/// numbers where the names show it.
void sortNaturally(std::vector<std::filesystem::path>& paths);

/// A text for each file, the grid's first, that those of one series share: the name without its numbers, but with what tells the
/// pieces of a step and the parts of a map apart. Opens files of NetCDF and Exodus.
std::vector<std::string> shapesOf(const OpenGridOptions& options);

}  // namespace curvisplat
