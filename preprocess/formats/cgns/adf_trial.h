// libcgns trusts the structures of ADF files: of damaged ones it reads memory that is not there. All nodes that a reader
// may come to are visited in a process of its own first, which may crash.
#pragma once

#include <filesystem>

namespace curvisplat {

/// Throws Error if libcgns crashes on the nodes of an ADF file, or on their first and last values; other files are left
/// alone. Visits 20,000 nodes
/// at most. Must not be called with dataLibraryMutex() held.
void tryAdf(const std::filesystem::path& path);

}  // namespace curvisplat
