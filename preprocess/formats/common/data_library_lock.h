// libcgns, HDF5 and NetCDF keep lists of open files and error stacks of the whole process, behind no lock of
// their own. So every call into any of them, by any reader, is made under this one.
#pragma once

#include <mutex>

namespace curvisplat {

/// Guards all of libcgns', HDF5's and NetCDF's state.
std::mutex& dataLibraryMutex();

}  // namespace curvisplat
