// `info` of grid files: what the reader found, before anything is converted.
#pragma once

#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"

namespace curvisplat {

/// Prints to stdout: the layout as detected, blocks, blanking, odd cells, bounds, the range of every scalar
/// that the files hold, what can be derived, overlapping blocks, what conversion would take, warnings. Reads
/// all values by slabs. Throws Error.
void printGridInfo(const OpenGridOptions& options, const DerivedOptions& derived, bool json);

}  // namespace curvisplat
