// Checks a classic NetCDF file's header, and its size against that. The NetCDF library returns zeros beyond the end
// of a file, so that an incomplete copy would look complete, and copies names of any length.
#pragma once

#include "stream/base/file.h"

namespace curvisplat {

/// Throws Error if `file`, which has the signature of classic NetCDF, ends before the end of its header or of
/// its last value, or has a name that is longer than the format allows.
/// Source: the NetCDF Classic Format Specification (NetCDF User's Guide, appendix B).
void checkClassicNetcdf(const InputFile& file);

}  // namespace curvisplat
