// The values of a grid at points, of the grid's own cells: what its files say, to the rounding of single precision.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// A sample of a structured grid near a point, where the cell with the point is looked for.
struct NearSample {
  uint32_t block = 0;
  std::array<uint64_t, 3> at{};
};

/// The values of the grid at a point.
struct SourceValues {
  uint32_t block = 0;  // from 0
  std::array<uint64_t, 3>
      at{};  // the nearest corner of the cell, or the cell of cell-centred scalars; of a mesh its number, and zeros
  glm::dvec3 place{0.0};       // of that node, or the middle of that cell
  std::vector<float> sample;   // [scalar]: there
  std::vector<double> values;  // [scalar]: at the point
};

/// A range in which the values of a scalar are that count; cells with others are passed over.
struct ValueRange {
  double lower, upper;
};

/// Returns for each point the values of the cell that has it: the first that is found around the samples in `near`, in their order;
/// nullopt if there is none. `scalars`: indices into the description. Reads boxes around the samples, and for points that have no cell
/// there the outermost cells of the blocks. Throws Error as reading does.
std::vector<std::optional<SourceValues>> probeGrid(const GridSource& source,
                                                   std::span<const uint32_t> scalars,
                                                   std::span<const ValueRange> ranges,
                                                   std::span<const glm::dvec3> points,
                                                   std::span<const std::vector<NearSample>> near);

/// Does the same for a mesh. It reads all points and cells, within 256 MiB and with temporary files in `scratch`.
std::vector<std::optional<SourceValues>> probeMesh(const MeshSource& source,
                                                   std::span<const uint32_t> scalars,
                                                   std::span<const ValueRange> ranges,
                                                   std::span<const glm::dvec3> points,
                                                   const ScratchFiles& scratch);

}  // namespace curvisplat
