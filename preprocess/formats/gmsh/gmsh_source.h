// Reads meshes of Gmsh (.msh), versions 4.1 and 2.2, in text or binary, with the time steps of values at
// nodes ($NodeData) and in elements ($ElementData).
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Whether the file begins with $MeshFormat.
bool isGmsh(const InputFile& file);

/// Reads the mesh and spools it: positions, nodes of the elements, values of the time step, 8 bytes for each
/// number. Elements without a volume are left out. Elements of second order are curved; those of higher
/// orders are drawn by their corners, with a warning. Throws Error.
std::unique_ptr<DataSource> openGmsh(const OpenGridOptions& options);

}  // namespace curvisplat
