// Checks the structure of an HDF5 file before libnetcdf opens it. libnetcdf (4.9.0) and HDF5's dimension
// scales read these attributes into buffers whose size they do not derive from the file:
//
//   object      attribute             checked
//   data sets   DIMENSION_LIST        lists of references, one for each dimension
//   data sets   _Netcdf4Coordinates   4-byte integers, one for each dimension
//   data sets   _Netcdf4Dimid         one integer
//   scales      NAME                  one terminated string of fixed length
//   root        _NCProperties         one string
//
// The lists of links and attributes are checked as hdf5_lists.h says. libnetcdf also copies longer names than it has
// room for, without their end, and follows links without recognising cycles. The walk therefore visits objects as it
// does and limits their number to what the file can hold.
#pragma once

#include <filesystem>

namespace curvisplat {

struct Netcdf4Structure {
  /// Whether the file has _NCProperties or dimension scales. Without these it was not written as NetCDF-4,
  /// though libnetcdf can read some of it.
  bool netcdf4 = false;
};

/// Throws Error with the object, the list or the attribute, and what was found and expected. Reports no object
/// that HDF5 cannot open: libnetcdf fails there without harm.
Netcdf4Structure checkNetcdf4Structure(const std::filesystem::path& path);

}  // namespace curvisplat
