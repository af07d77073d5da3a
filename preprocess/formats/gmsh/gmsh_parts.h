// The head of a file of Gmsh, and whether it is one of the files that Gmsh saves for the partitions of a mesh
// (Mesh.PartitionSplitMeshFiles: NAME_1.msh, NAME_2.msh, ...), in version 4.1.
#pragma once

#include <cstdint>
#include <filesystem>

#include "preprocess/formats/gmsh/gmsh_reader.h"

namespace curvisplat {

/// Reads $MeshFormat, sets how the reader reads numbers, and returns the version. Throws Error if it is not read.
double readGmshFormat(GmshReader& reader);

struct GmshPart {
  uint64_t part = 0, parts = 1;  // from 1; 1 of the whole mesh
};

/// Reads a section $PartitionedEntities of version 4.1 from its first number on. A file with volumes of several partitions is whole.
GmshPart readGmshPart(GmshReader& reader);

/// The number of files that the mesh of a file was saved in; 1 if the file does not say.
uint64_t gmshParts(const std::filesystem::path& path);

}  // namespace curvisplat
