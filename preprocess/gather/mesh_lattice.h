// A coarse structured grid in place of a mesh, for a first picture of a large one: a lattice over the mesh's box, with lines
// that are denser where the mesh has more points. Made in two passes over the points and one over the cells, which takes about as
// long as reading them.
#pragma once

#include <cstdint>
#include <memory>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// A lattice of at most `nodes` nodes (8 at least) with the reader's scalars, in this order, at its nodes, whatever their
/// centring in the mesh. A node has the mean of the cells whose bounding boxes contain it, small ones counting more, or else of the
/// cells nearest to it that contain no node; where there is none it is blanked. So the lattice covers the mesh, and may go beyond
/// its surface by a cell. nullptr if the mesh has no extent in some direction, or if its points take more than `memory_bytes`.
/// Throws Error as reading does, and Interrupted once `progress` is stopped.
std::unique_ptr<GridSource> latticeOf(const MeshReader& mesh, uint64_t nodes, uint64_t memory_bytes,
                                      Progress& progress);

}  // namespace curvisplat
