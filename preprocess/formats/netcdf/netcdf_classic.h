// How long a classic NetCDF file must be, by its header. NetCDF itself reads zeros behind the end of a file,
// so that one whose copying broke off would look whole.
#pragma once

#include "stream/base/file.h"

namespace curvisplat {

/// Throws Error if `file`, which begins as a classic NetCDF file does, ends before its header or its last
/// value does.
/// Source: the NetCDF Classic Format Specification (NetCDF User's Guide, appendix B).
void checkClassicNetcdf(const InputFile& file);

}  // namespace curvisplat
