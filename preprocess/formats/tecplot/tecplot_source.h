// A Tecplot file, text or binary, as a grid of blocks: its ORDERED zones, or where there are none as a mesh of pieces: its zones of
// tetrahedra and bricks; and its variables besides the coordinates as scalars.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

bool isTecplot(const InputFile& file);

/// Coordinates: the variables named x, y and z (also "X [m]", CoordinateX), else the first three. A variable iblank hides
/// nodes where it is 0, and marks those of the fringe where it is negative. Zones with times are the steps of a series;
/// zones without belong to all steps. A variable of nodes in some zones and of cells in others becomes two scalars,
/// "p:node" and "p:cell". Zones without volume are left out with a warning. Throws Error.
std::unique_ptr<DataSource> openTecplot(const OpenGridOptions& options);

}  // namespace curvisplat
