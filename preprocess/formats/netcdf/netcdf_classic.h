// Checks a classic NetCDF file's header, and its size against that. The NetCDF library returns zeros beyond the end
// of a file, so that an incomplete copy would look complete, and copies names of any length.
#pragma once

#include <cstdint>

#include "stream/base/file.h"

namespace curvisplat {

/// Throws Error if `file`, which has the signature of classic NetCDF, ends before the end of its header or of
/// its last value, or has a name that is longer than the format allows.
/// Returns the length of the record dimension. In a file that is still being written, whose header does not have it, it is
/// the number of records that are complete; the library takes it for 2^32 - 1.
/// Source: the NetCDF Classic Format Specification (NetCDF User's Guide, appendix B).
uint64_t checkClassicNetcdf(const InputFile& file);

}  // namespace curvisplat
