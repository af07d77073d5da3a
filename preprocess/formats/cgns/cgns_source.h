// A CGNS file, HDF5 or ADF, as a grid of the structured zones of all bases, or as a mesh of the
// unstructured ones. Their scalars are the fields of vertex and cell-centred solutions at one time step. A
// field that is missing in some zones is NaN there, which blanks their samples; a warning reports it. A
// field that is node-centred in some zones and cell-centred in others becomes two scalars, "Density:node"
// and "Density:cell". VelocityX, VelocityY and VelocityZ also give their magnitude, "Velocity:mag".
//
// A whole zone is never held: each read fetches the requested part from the file. Any number of
// threads may read. Neither HDF5 nor libcgns is thread-safe, so that their reads run one after the other.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Structured zones as a grid of a block each, or unstructured ones as a mesh of a piece each. Throws Error if a zone is damaged, or
/// if no unstructured one has a solid element.
std::unique_ptr<DataSource> openCgns(const OpenGridOptions& options);

}  // namespace curvisplat
