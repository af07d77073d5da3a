// The header of an ADF file, which libcgns trusts.
#pragma once

#include "stream/base/file.h"

namespace curvisplat {

/// Throws Error if an ADF file is shorter than its header says: libcgns reads text without an end from
/// blocks that are not there.
void requireWholeAdf(const InputFile& file);

}  // namespace curvisplat
