// Checks what libnetcdf (4.9.0) trusts in a file, before libnetcdf opens it.
//
// In a classic file (CDF-1, 2, 5): the header and the size. libnetcdf returns zeros beyond the end of a
// file, so that an incomplete copy would look complete, and it copies names of any length.
//
// In an HDF5 file (NetCDF-4): attributes that libnetcdf and HDF5's dimension scales read into buffers whose
// size they do not derive from the file, the lists of links and attributes (common/hdf5_objects.h), the
// length of names, and cycles of links.
//
// Each check reads the metadata once; its memory grows with the number of variables and the depth of groups.
// Any thread may call it; the HDF5 check holds dataLibraryMutex().
#pragma once

#include <cstdint>
#include <filesystem>

#include "stream/base/file.h"

namespace curvisplat {

/// Throws Error if `file`, which has the signature of classic NetCDF, ends before the end of its header or
/// of its last value, or has a name that is longer than the format allows.
/// Returns the length of the record dimension. The header of a file that is still being written does not
/// state it; it is then the number of complete records, where libnetcdf would assume 2^32 - 1.
/// Source: the NetCDF Classic Format Specification (NetCDF User's Guide, appendix B).
uint64_t checkClassicNetcdf(const InputFile& file);

struct Netcdf4Structure {
  /// Whether the file has _NCProperties or dimension scales. Without these it was not written as NetCDF-4,
  /// though libnetcdf can read some of it.
  bool netcdf4 = false;
};

/// Checks the attributes of an HDF5 file:
///
///   object      attribute             expected
///   data sets   DIMENSION_LIST        lists of references, one for each dimension
///   data sets   _Netcdf4Coordinates   4-byte integers, one for each dimension
///   data sets   _Netcdf4Dimid         one integer
///   scales      NAME                  one terminated string of fixed length
///   root        _NCProperties         one string
///
/// It visits objects as libnetcdf does, and limits their number to what the file can hold, which ends cycles
/// of links. Throws Error with the object, the list or the attribute, and what was found and expected. It
/// does not report objects that HDF5 cannot open: libnetcdf fails there without harm.
Netcdf4Structure checkNetcdf4Structure(const std::filesystem::path& path);

}  // namespace curvisplat
