// Cells to splats, for cell-centred values. Each cell becomes a splat with the centre, the Jacobian and the
// volume of the hexahedron between its eight nodes. Nothing is averaged to nodes, and since cells of abutting
// blocks abut, nothing is merged at seams. Only in a block that is one cell thick along an axis is each cell
// two splats along it, half a cell each: a border code has one face across each axis.
//
// A splat's axes are the Jacobian's, scaled alike so that their product is the hexahedron's volume: then a
// constant field has the same density in every cell. Along each lattice axis they are stretched as those of
// nodes are (stretch.h), but not where the cell is the last one in its block or beside one that is missing:
// whether that is a border depends on other blocks. Where cells grow, the centre moves a little
// (Stretch::drift). Where the scalar bends, means are corrected as those of nodes are. The slope is that of
// the linear field through the centres of the neighbouring cells; where one is missing (block end, blanked)
// the difference is one-sided.
//
// A cell without a neighbour on one side ends at a border there, and its splat remembers where
// (stream/model/border_code.h). A cell of an abutting block is a neighbour, too.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// A block, and which of its end faces abut cells of other blocks.
struct BlockEnds {
  size_t block = 0;
  const AbuttingFaces* faces = nullptr;  // null: no cell ends at a border
};

/// The nodes that are read around the cells of a box: those of two cells on either side.
inline constexpr Halo kCellSplatHalo{2, 3};

/// Scratch memory of computeCellSplats(); keeps its capacity.
struct CellScratch {
  std::vector<glm::dvec3> centre;
  std::vector<uint8_t> there;
  std::array<std::vector<glm::dvec3>, 3> edge;  // along i, j, k: the sum of the cell's four edges
};

/// Computes the splats of the cells whose lowest nodes are in `box`, except for cells with a blanked corner
/// or value. A splat has the number of its cell's lowest node; the upper half of a cell, that of the next
/// node along the axis. `in.window` is `box` with kCellSplatHalo around it inside the block; `in.nodes` are
/// as a NodeReader of cell-centred scalars reads them. Overwrites `out` and keeps its capacity. Only the rules
/// `dual_cells` (halves in blocks one cell thick) and `widths` and the corrections `stretch` and `growth` apply to cells.
/// Pure: any thread. Throws nothing but bad_alloc.
void computeCellSplats(const BlockWindow& in, const NodeBox& box, const BlockEnds& ends, CellScratch& scratch,
                       NodeSplats& out, const SplatRules& rules = {});

}  // namespace curvisplat
