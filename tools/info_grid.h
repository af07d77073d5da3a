// `info` of grid files: what the reader found, before anything is converted.
#pragma once

#include "preprocess/open_grid.h"

namespace curvisplat {

/// Prints to stdout: the layout as detected, blocks, blanking, bounds, the range of every scalar, warnings.
/// Reads all values once, by slabs. Throws Error.
void printGridInfo(const OpenGridOptions& options, bool json);

}  // namespace curvisplat
