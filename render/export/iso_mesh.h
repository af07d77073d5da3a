// An isosurface of a cache as triangles, for other programs: .ply, .stl (both binary) and .vtp.
//
// It is that of the field which pictures show (render/surface/iso_rays.h), by surface nets: on a lattice of cubes, each cube whose
// corners lie on both sides of the value has one vertex, which is moved onto the surface along the gradient; four cubes around an edge
// that crosses the surface make two triangles. So the mesh has no gaps, also where bricks of different levels meet; it ends at the
// data's borders. Normals point to smaller values, and triangles are counter-clockwise as they are seen from there.
//
// The lattice's columns are sampled in tiles of 32x32, as many at a time as the memory holds; vertices and triangles wait in temporary
// files. The same bytes for any threads and memory.
#pragma once

#include <cstdint>
#include <filesystem>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The options of writeIsoMesh().
struct IsoMeshOptions {
  double value = 0;
  uint32_t voxels = 256;  // cubes along the longest side of the data
  uint64_t memory_bytes = 512 << 20;
  unsigned threads = 0;
};
/// The results of writeIsoMesh().
struct IsoMeshReport {
  uint64_t vertices = 0, triangles = 0;
  double voxel_size = 0;  // world units
  double thin_part =
      0;  // of the splats that the surface may lie in: thinner than half a voxel, so that it may be missing there
};

/// Whether writeIsoMesh() knows the extension.
bool isIsoMeshName(const std::filesystem::path& path);

/// Throws UsageError if no sample of the variable has as small or as large a value.
void requireIsovalue(const CacheReader& cache, size_t variable, double value);

/// The bricks are those whose merged detail is below half a voxel. The file appears whole or not at all. Throws UsageError if the memory
/// is too little, and Error if there is no such surface, if a file cannot be written, and as CacheReader does.
IsoMeshReport writeIsoMesh(const CacheReader& cache, size_t variable, const IsoMeshOptions& options,
                           const std::filesystem::path& path, Progress& progress);

}  // namespace curvisplat
