// libcgns, HDF5 and NetCDF keep global lists of open files and global error stacks without any lock. Every
// call into any of them, by any reader, holds this mutex.
#pragma once

#include <mutex>

namespace curvisplat {

/// Guards the global state of libcgns, HDF5 and NetCDF.
std::mutex& dataLibraryMutex();

}  // namespace curvisplat
