// A cache's scalar as an OpenVDB file, which Blender, Houdini and others read: two sparse grids of floats, means over voxels.
//
//   density   a fog volume: 1 inside the data to within a tenth, less in voxels at its border, inactive outside
//   value     the scalar, in the same voxels
//
// The voxel (i, j, k) has its middle at world = lower + (i + 0.5, j + 0.5, k + 0.5) * voxel size; both grids carry that transform.
// The scalar's name, unit and time are metadata of `value`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The options of writeVdb().
struct VdbOptions {
  uint32_t voxels = 256;              // along the longest side
  uint64_t memory_bytes = 512 << 20;  // for voxels, while they are sampled and in the grids
  unsigned threads = 0;
};
/// The results of writeVdb().
struct VdbReport {
  uint64_t active = 0;  // voxels
  glm::dvec3 lower{0.0};
  double voxel_size = 0;  // world units
};

/// The bricks are those whose merged detail is below half a voxel. The file appears whole or not at all. Throws UsageError if
/// options.memory_bytes is too small for the voxels that were asked for, Error as CacheReader does and if the file cannot be written.
VdbReport writeVdb(const CacheReader& cache, size_t variable, const VdbOptions& options,
                   const std::filesystem::path& path, Progress& progress);

}  // namespace curvisplat
