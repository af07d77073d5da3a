// HDF5 (1.10) trusts the structures of a file whose checksums are right: of damaged ones it reads and frees memory that is
// not there, or does not come to an end. What it does is tried in a process of its own first, which may crash.
//
// The trial walks all objects, links, attributes and indices, and reads small chunks; values are read by the caller alone.
// It costs a fork and what opening the file costs. Each file is tried once as long as it stays as it is. Without a
// process to be had (ulimit -u) nothing is tried.
#pragma once

#include <filesystem>
#include <functional>

namespace curvisplat {

/// Throws Error if HDF5 crashes on the file, or takes too long. `more`, if given, runs in the process of the trial, too:
/// what it throws does not matter. Must not be called with dataLibraryMutex() held.
void tryHdf5(const std::filesystem::path& path, const std::function<void()>& more = nullptr);

}  // namespace curvisplat
