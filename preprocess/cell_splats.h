// Cells to splats, for values that stand in cells: the cell is the splat, its centre, Jacobian and volume
// those of the hexahedron between its eight nodes. Nothing is averaged to nodes, there are no half cells, and
// cells of abutting blocks abut: nothing is merged at seams.
//
// A splat's axes are the Jacobian's, scaled alike so that their product is the hexahedron's volume: then a
// constant field has the same density in every cell. The slope is that of the linear field through the
// centres of the neighbouring cells; a missing one (the block ends, or it is not there) makes the difference
// one-sided.
//
// At the grid's faces whole cells end less sharply than the half cells of nodes. The half-annulus: 60.3
// / 66.1 / 55.5 dB for the smooth, band and step functions, as many nodes 64.1 / 67.6 / 57.1.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/node_splats.h"
#include "preprocess/slabs.h"

namespace curvisplat {

/// A cell's own nodes, and those of its neighbours.
inline constexpr Halo kCellHalo{1, 2};

/// What computeCellSplats() needs for a while; keeps its capacity.
struct CellScratch {
  std::vector<glm::dvec3> centre;
  std::vector<uint8_t> there;
};

/// Computes the splats of the cells whose lowest nodes are in `box` and that are there: all of their corners
/// are, and their values. A splat's number is that of the cell's lowest node. `in.window` is `box` and
/// kCellHalo where the block goes on; `in.nodes` as a NodeReader of cell-centred scalars gives them.
/// Overwrites `out` and keeps its capacity. Pure: any thread. Throws nothing but bad_alloc.
void computeCellSplats(const BlockWindow& in, const NodeBox& box, CellScratch& scratch, NodeSplats& out);

}  // namespace curvisplat
