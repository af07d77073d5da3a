// libcgns, HDF5 and NetCDF keep global lists of open files and global error stacks without any lock. Every
// call into any of them, by any reader, holds this mutex.
#pragma once

#include "stream/base/mutex.h"

namespace curvisplat {

/// Guards the global state of libcgns, HDF5 and NetCDF.
Mutex& dataLibraryMutex();

}  // namespace curvisplat
