// Tries what libcgns does with an ADF file that may be damaged or hostile, as library_trial.h does for HDF5.
#pragma once

#include <filesystem>

namespace curvisplat {

/// Visits the nodes of an ADF file, 20,000 at most, with their first and last values, in a child process
/// (library_trial.h), and throws Error if libcgns crashes there: in a damaged file, it reads memory that
/// does not exist. Files of other formats are left alone. Must not be called with dataLibraryMutex() held.
void tryAdf(const std::filesystem::path& path);

}  // namespace curvisplat
