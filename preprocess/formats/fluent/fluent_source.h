// Cases of Ansys Fluent in HDF5 (Common Fluids Format): a mesh of faces, each with the cells on its two sides, in
// NAME.cas.h5, and values in cells in NAME.dat.h5.
//
//   /meshes/1                        attributes dimension, nodeCount, faceCount, cellCount
//   /meshes/1/nodes/coords/ID        positions of a zone of nodes
//   /meshes/1/faces/nodes/N          of a section of faces: nnodes, the nodes of each; nodes
//   /meshes/1/faces/c0/N, c1/N       the cells on both sides; c1 of inner faces alone
//   /meshes/1/cells/zoneTopology     id, name, minId, maxId of each zone of cells; faces/zoneTopology as well
//   /results/1/phase-P/cells/NAME/N  values in a section of cells
//
// Everything is numbered from 1, and each section has the attributes minId and maxId.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Whether the file is a Fluent case or its data. Throws Error if it is truncated HDF5.
bool isFluentHdf5(const InputFile& file);

/// Reads a case, with the data file that is named after it, or else the one of the same name beside it.
/// Spools where each face begins, and the faces of each cell; the rest is read by position. Scalars are
/// called SV_P, SV_U and so on, those of further phases phase-2:SV_VOF. Throws Error if a file is missing or
/// damaged.
std::unique_ptr<DataSource> openFluent(const OpenGridOptions& options);

}  // namespace curvisplat
