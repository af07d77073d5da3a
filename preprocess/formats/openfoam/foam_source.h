// OpenFOAM cases: constant/polyMesh, moving ones in the folders of times, and fields of cells; ASCII and binary,
// compressed or not; decomposed cases (processor0, processor1, ..., or collated: processors8), which are pieces of one
// mesh, and so are the regions of a case (constant/fluid/polyMesh). A case that also has its mesh in its own folder is
// read from there, unless only the processors have the last times.
#pragma once

#include <filesystem>
#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Whether `path` is a case: its folder, ParaView's empty file NAME.foam in it, or the folder of a region,
/// CASE/constant/REGION.
bool isFoamCase(const std::filesystem::path& path);

/// Reads the mesh and spools it: numbers of 8 bytes, and the faces of each cell. Fields are spooled when they are first
/// read. Scalars are the fields of the time step: volScalarField NAME; volVectorField NAME:mag, NAME:x, NAME:y, NAME:z;
/// tensors NAME:0, NAME:1, ... Without fields there are none. Throws Error if a file is missing or damaged.
std::unique_ptr<DataSource> openFoam(const OpenGridOptions& options);

}  // namespace curvisplat
