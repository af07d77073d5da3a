// `info` of grid files: what the reader finds in them, without a conversion.
#pragma once

#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"

namespace curvisplat {

/// Prints to standard output: the detected layout, blocks, blanking, degenerate and inverted cells, bounds,
/// the range of every stored scalar, the derivable scalars, overlapping blocks, warnings, and an estimate of
/// the conversion. Reads all values slab by slab. Throws Error.
void printGridInfo(const OpenGridOptions& options, const DerivedOptions& derived, bool json);

}  // namespace curvisplat
