// Opens a curvilinear grid by the CF conventions, without the gaps that models leave in grids around the
// Earth. The faces of a cubed sphere may be in one file, or in a file for each: FV3 and FMS write
// NAME.tile1.nc to NAME.tile6.nc.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Opens the files, and closes a grid that runs around the Earth (closed_grid.h, joined_faces.h). Throws
/// Error.
std::unique_ptr<GridSource> openNetcdf(const OpenGridOptions& given);

}  // namespace curvisplat
