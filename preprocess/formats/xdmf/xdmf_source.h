// An XDMF file as a grid of blocks or as a mesh of pieces: its structured grids, or where there are none its unstructured ones,
// and their attributes as scalars.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Attributes of one component give a scalar NAME; of two or three NAME:mag, NAME:x, ...; of more NAME:0, NAME:1, ... An
/// attribute that some grids lack is NaN there, which blanks their samples; a warning reports it. Throws Error.
std::unique_ptr<DataSource> openXdmf(const OpenGridOptions& options);

}  // namespace curvisplat
