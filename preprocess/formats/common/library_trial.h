// Work of a library on a file that may be damaged, tried in a process of its own, which may crash (hdf5_trial.h).
#pragma once

#include <filesystem>
#include <functional>

namespace curvisplat {

/// Throws Error if `work` crashes or takes too long; what it throws does not matter. Each file is tried once as long as
/// it stays as it is, nothing if no process can be had. `library`, for the message, needs a literal. Must not be called
/// with dataLibraryMutex() held.
void tryLibrary(const char* library, const std::filesystem::path& path, const std::function<void()>& work);

}  // namespace curvisplat
