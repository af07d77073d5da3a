// `curvisplat info` of an unstructured grid.
#pragma once

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Reads the mesh and prints what is in it. Throws Error if its files are damaged.
void printMeshInfo(const MeshSource& source, bool json);

}  // namespace curvisplat
