// Faces of a cache's grid with further values: of scalars that are added, or of a time step.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/grid/node_reader.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct FurtherFaces {
  const CacheReader& cache;  // at a step of the geometry
  const NodeReader& reader;  // of the grid, with the values
  std::filesystem::path scratch;
  std::string name;                 // of the file, in the cache's own folder
  std::vector<uint32_t> variables;  // numbers in the cache
};

/// Which faces.bin of the geometry has: outer faces, and the index planes inside of blocks that a conversion was asked
/// for. Nothing, and no file, where there is no faces.bin. Reads the faces' slabs of the grid once more. Throws Error
/// as writeGridFaces().
std::optional<FileInfo> writeFurtherFaces(const FurtherFaces& job, const MemoryPlan& plan,
                                          Progress& progress);

/// The index planes inside of blocks that a cache has.
std::vector<IndexPlane> planesOf(const CacheReader& cache);

}  // namespace curvisplat
