// Cells to splats, for cell-centred values: the cell is the splat, its centre, Jacobian and volume
// those of the hexahedron between its eight nodes. Nothing is averaged to nodes, there are no half cells, and
// cells of abutting blocks abut: nothing is merged at seams.
//
// A splat's axes are the Jacobian's, scaled alike so that their product is the hexahedron's volume: then a
// constant field has the same density in every cell. Along each lattice axis they are stretched as those of
// nodes are (stretch.h), but not where the cell is the last one in its block or beside one that is missing:
// whether that is a border depends on other blocks. The slope is that of the linear field through the centres
// of the neighbouring cells; where one is missing (block end, blanked) the difference is one-sided.
//
// A cell that has no neighbour ends at a border, and its splat remembers where (stream/border_code.h); there is
// a neighbour, too, where blocks abut.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// The surroundings of a block's ends.
struct BlockEnds {
  size_t block = 0;
  const AbuttingFaces* faces = nullptr;  // null: no cell ends at a border
};

/// The nodes that are read around the cells of a box: two cells on either side, and the nodes behind the
/// last.
inline constexpr Halo kCellSplatHalo{2, 3};

/// Scratch memory of computeCellSplats(); keeps its capacity.
struct CellScratch {
  std::vector<glm::dvec3> centre;
  std::vector<uint8_t> there;
  std::array<std::vector<double>, 3> extent;  // squared, along i, j, k; times 16
};

/// Computes the splats of the cells whose lowest nodes are in `box`, except for cells with a blanked corner or
/// value. A splat has the number of its cell's lowest node. `in.window` is `box` with kCellSplatHalo around it
/// inside the block; `in.nodes` are as a NodeReader of cell-centred scalars reads them.
/// Overwrites `out` and keeps its capacity. Of the corrections only `stretch` applies to cells. Pure: any
/// thread. Throws nothing but bad_alloc.
void computeCellSplats(const BlockWindow& in, const NodeBox& box, const BlockEnds& ends, CellScratch& scratch,
                       NodeSplats& out, const NodeSplatCorrections& corrections = {});

}  // namespace curvisplat
