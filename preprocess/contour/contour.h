// The isosurface of a node-centred scalar of a grid, of the grid's own cells: with a vertex wherever an edge of a cell crosses the value.
//
// Cells with a blanked corner, or with one whose value is not in the given range, have no surface. Where structured blocks overlap, each
// has its own. The same triangles in the same order for any memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "preprocess/contour/contour_mesh.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// The surface, and the values that count.
struct ContourOptions {
  uint32_t scalar = 0;  // index into the description; node-centred
  double value = 0;
  double lower = 0, upper = 0;  // a corner with another value is passed over
  uint64_t memory_bytes = 512 << 20;
};

/// The least and the largest value of the corners that count; lower > upper if there are none.
struct ContourRange {
  double lower = std::numeric_limits<double>::infinity(), upper = -std::numeric_limits<double>::infinity();

  void add(double value) {
    lower = std::min(lower, value);
    upper = std::max(upper, value);
  }
};

/// Writes the surface into `sink`, and returns the values met. Takes some 30 MiB, and the vertices that slabs share. Throws Error as
/// reading does, Interrupted once `progress` is stopped.
ContourRange contourGrid(const GridSource& source, const ContourOptions& options, TriangleSink& sink,
                         Progress& progress);

/// Does the same for a mesh, within `memory_bytes` besides the vertices of the surface. Temporary files lie in `scratch`.
ContourRange contourMesh(const MeshSource& source, const ContourOptions& options, const ScratchFiles& scratch,
                         TriangleSink& sink, Progress& progress);

}  // namespace curvisplat
