// Where an HDF5 file has to end, by its superblock: a shorter one is truncated, which HDF5 reports as an unknown error.
#pragma once

#include "stream/base/file.h"

namespace curvisplat {

/// Throws TruncatedFile if `file` begins as HDF5 and ends before the address that its superblock (versions 0 to 3) states.
void requireWholeHdf5(const InputFile& file);

}  // namespace curvisplat
