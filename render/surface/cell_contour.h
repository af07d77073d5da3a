// The isosurface of a grid's nodes (grid_nodes.h) as triangles, cell by cell: with a vertex wherever an edge of a cell crosses the value.
//
// A face on which the value crosses all four edges cuts off the corners at or above the value one by one, so both of its cells have the
// same lines there: the surface has no holes within a block. Cells with a blanked corner are left out. Each edge has one vertex, which all
// cells around it share. One thread; pure.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "render/mesh/triangle_mesh.h"
#include "render/project/plane_cuts.h"
#include "render/surface/grid_nodes.h"

namespace curvisplat {

/// The isosurface at `value`; none if it has more than `most` triangles. Scalars of the mesh are those of the second scalar, if the nodes
/// have one. What clip planes leave out is not there.
std::optional<TriangleMesh> contourCells(const GridNodes& nodes, double value,
                                         std::span<const ClipPlane> planes, uint64_t most);

}  // namespace curvisplat
