// Meshes of Gmsh (.msh), versions 4.1, 4.0 and 2.2, in text or binary, with values at nodes ($NodeData), in elements ($ElementData) and
// at the nodes of each element ($ElementNodeData), of several steps.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Whether the file begins with $MeshFormat, or with $Comments.
bool isGmsh(const InputFile& file);

/// The number of files that Gmsh saved the mesh of this one in, by its partitions; 1 if it does not say, or is none of Gmsh.
uint64_t gmshFiles(const std::filesystem::path& path);

/// Reads the mesh and spools it: positions, nodes of the elements, values of the time step, 8 bytes each. Elements without a volume are
/// left out. Those of higher order are curved (gmsh_elements.h). Throws Error.
std::unique_ptr<DataSource> openGmsh(const OpenGridOptions& options);

}  // namespace curvisplat
