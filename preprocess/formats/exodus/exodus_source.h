// Exodus II files (.e, .ex2, .exo; NetCDF classic and NetCDF-4): element blocks of one shape each, with scalars at
// nodes and in elements, of one time step.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether it is a NetCDF file with the dimensions and attributes of Exodus.
bool isExodus(const InputFile& file);

/// Scalars: the nodal and element variables by their names. An element variable that a block lacks is NaN there. Throws Error
/// if the file is damaged, or has no block of solid elements.
std::unique_ptr<DataSource> openExodus(const OpenGridOptions& options);

}  // namespace curvisplat
