// SU2's native mesh (.su2), a text:
//
//    NDIME= 3
//    NELEM= 1
//    10 0 1 2 3 0          VTK's type of the cell, its points from 0, and often its number
//    NPOIN= 4
//    0.0 0.0 0.0 0         x, y, z, and often its number
//    NMARK= 1              boundaries: MARKER_TAG=, MARKER_ELEMS=, their faces
//
// Several zones (NZONE=, IZONE=) follow one another. `%` begins a comment.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_files.h"
#include "preprocess/formats/common/spooled_mesh.h"

namespace curvisplat {

struct Su2Zone {
  SpooledMesh mesh;
  std::vector<std::string> markers;  // of its boundaries
};

/// Passes through the file once. Throws Error with the line if it is damaged, or if it has not three dimensions.
std::vector<Su2Zone> readSu2Mesh(const std::shared_ptr<const PooledFile>& file,
                                 const std::filesystem::path& folder);

}  // namespace curvisplat
