// Checks a classic NetCDF file's size against its header. The NetCDF library returns zeros beyond the end of
// a file, so that an incomplete copy would look complete.
#pragma once

#include "stream/base/file.h"

namespace curvisplat {

/// Throws Error if `file`, which has the signature of classic NetCDF, ends before the end of its header or of
/// its last value.
/// Source: the NetCDF Classic Format Specification (NetCDF User's Guide, appendix B).
void checkClassicNetcdf(const InputFile& file);

}  // namespace curvisplat
