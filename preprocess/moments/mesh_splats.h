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

/// The sums of the least squares of a cell's slopes: Σ d dᵀ / |d|² and Σ d Δf / |d|² of its neighbours.
inline constexpr size_t slopeSumCount(size_t fields) {
  return 6 + 3 * fields;
}
/// Adds a neighbour, at `step` from the cell; its values and the cell's, [field].
void addNeighbour(const glm::dvec3& step, std::span<const float> neighbour, std::span<const float> own,
                  std::span<double> sums);
/// The gradient of a field. Directions in which the neighbours say nothing, at borders, have none.
glm::dvec3 gradientOfSums(std::span<const double> sums, size_t field);

/// The splat of a cell.
void splatOfCell(uint64_t node, const CellBody& body, std::span<const float> cell_values,
                 std::span<const double> sums, NodeSplat& splat, std::span<SplatScalar> values);

}  // namespace curvisplat
