// The example of the window's start page: a small series that shows what the program does without a file of one's own.
#pragma once

#include <filesystem>
#include <vector>

#include "stream/base/progress.h"

namespace curvisplat {

/// Returns its files as `view` takes them, beside the folder of kept caches, whether they are there or not: the wake behind
/// a cylinder, 74,000 nodes in eight steps. Throws Error if the user has no folder for caches.
std::vector<std::filesystem::path> exampleFiles();

/// Writes them unless they are there. Throws Error, and Interrupted once `progress` is stopped.
void writeExample(Progress& progress);

}  // namespace curvisplat
