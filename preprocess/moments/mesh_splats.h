// Splats of unstructured grids: of a point from the moments of its dual cell, of a cell from its own and its
// neighbours' values. DESIGN.md, "Unstructured grids".
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/moments/cell_moments.h"
#include "preprocess/splats/node_splats.h"

namespace curvisplat {

/// A point's dual cell: moments (cell_moments.h) about the point and its values.
struct DualCell {
  glm::dvec3 point{0.0};
  std::span<const float> values;  // [field]
  std::span<const double> moments;
};

/// The splat of a dual cell with volume; `node`: its number. Values are [field]. Pure: any thread.
void splatOfPoint(uint64_t node, const DualCell& dual, NodeSplat& splat, std::span<SplatScalar> values);

/// The neighbours of a cell: where their centres are from its own, and their values, [neighbour * fields + field].
struct CellNeighbours {
  std::span<const glm::dvec3> steps;
  std::span<const float> values;
};

/// The gradients of the fields by least squares, weighted by 1 / distance², [field]. Directions in which the
/// neighbours say nothing, at borders, have none.
void leastSquares(const CellNeighbours& neighbours, std::span<const float> own, std::span<glm::dvec3> out);

/// The splat of a cell.
void splatOfCell(uint64_t node, const CellBody& body, std::span<const float> own,
                 const CellNeighbours& neighbours, NodeSplat& splat, std::span<SplatScalar> values);

}  // namespace curvisplat
