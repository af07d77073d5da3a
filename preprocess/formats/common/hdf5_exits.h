// Finds what leads out of an HDF5 file, without following it: external links, and sources of virtual data sets. They may lead to
// regular files in the folder of the file, which have the values themselves. Only for files that HDF5 survives (library_trial.h), and
// not while holding dataLibraryMutex().
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace curvisplat {

/// The places that an HDF5 file leads to.
struct Hdf5Exits {
  struct VirtualSource {
    std::filesystem::path file;
    std::string set;
  };
  std::set<std::filesystem::path> files;  // that exist
  std::vector<VirtualSource> sources;     // of virtual data sets
};

/// Finds nothing if HDF5 cannot open the file. Throws Error if it leads where it may not.
Hdf5Exits exitsOf(const std::filesystem::path& path);

/// Throws Error if one of the sources is virtual itself. exitsOf() must have passed all files: HDF5 may follow their links.
void requireStored(const std::filesystem::path& path, const std::vector<Hdf5Exits::VirtualSource>& sources);

}  // namespace curvisplat
