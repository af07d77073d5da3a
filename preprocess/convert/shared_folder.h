// Folders on a file system that several ranks share.
#pragma once

#include <filesystem>

#include "stream/base/ranks.h"

namespace curvisplat {

/// Rank 0's `folder`, at every rank: an absolute path. All have to call it. Throws Error at a rank that does not see it.
std::filesystem::path sharedFolder(const std::filesystem::path& folder, Ranks& ranks);

/// Makes an empty folder for a rank's own temporary files in `shared`. Throws Error if it cannot.
std::filesystem::path makeFolderOfRank(const std::filesystem::path& shared, unsigned rank);

}  // namespace curvisplat
