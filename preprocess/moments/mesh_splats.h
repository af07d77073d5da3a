// Splats of unstructured grids: of a point from the moments of its dual cell, of a cell from its own and
// its neighbours' values; and where they end, at the outer faces of the mesh, which only one cell has.
// DESIGN.md, "Unstructured grids". Pure: any thread.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/moments/cell_moments.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// A point's dual cell: moments (cell_moments.h) about the point and its values.
struct DualCell {
  glm::dvec3 point{0.0};
  std::span<const float> values;  // [field]
  std::span<const double> moments;
};

/// The splat of a dual cell with volume; `node`: its number. Values are [field].
void splatOfPoint(uint64_t node, const DualCell& dual, NodeSplat& splat, std::span<SplatScalar> values);

/// A share of an outer face, at which splats end.
struct OuterPlane {
  glm::dvec3 inward{0.0};  // at right angles to the face, as long as the share is large; not 0
  glm::dvec3 point{0.0};   // the face's centre
  bool touches =
      true;  // it is a face of the splat's; else of one beside it, which the splat may reach beyond
};

/// Fits the splat of a point, as splatOfPoint() makes it, to the cells on the other side of faces that do not fit together. Nodes
/// hang there: the dual cells of fine cells end at the coarse ones' faces, beside dual cells that are twice as wide, and a blur
/// (stretch.h) has to vary slowly. So splats of one side become thicker and move towards the face; those of both sides become
/// thicker and move on towards the larger cells. What m, the way from the point to the splat's middle, says suffices. A uniform
/// medium was off by 3 to 6 % (rms) at planes, edges and corners of refined parts, and is by 0.3 to 1 %. Lengths across outer
/// faces stay, which cuts are fitted for.
void fitAtHangingNode(std::span<const OuterPlane> outer, NodeSplat& of_point, std::span<SplatScalar> values);

/// A part of a cell's face that a larger or smaller cell lies against.
struct CellSide {
  glm::dvec3 outward{0.0};    // at right angles to the face, as long as the area of that part
  glm::dvec3 face{0.0};       // the centre of the whole face
  glm::dvec3 neighbour{0.0};  // the centre of the other cell
};

/// The neighbours of a cell: where their centres are from its own, and their values, [neighbour * fields +
/// field].
struct CellNeighbours {
  std::span<const glm::dvec3> steps;
  std::span<const float> values;
  std::span<const CellSide> sides = {};
};

/// Fits the body of a cell's splat to larger and smaller cells beside it, as stretch, drift and skew fit nodes where
/// cells change in size (stretch.h). Along a row of cells of 1 and 2, a uniform medium is even to 0.5 % then, and to
/// 17 % otherwise.
void fitToSizes(std::span<const CellSide> sides, NodeSplat& of_cell);

/// The gradients of the fields by least squares, weighted by 1 / distance², [field]. Directions in which the
/// neighbours say nothing, at borders, have none.
void leastSquares(const CellNeighbours& neighbours, std::span<const float> own, std::span<glm::dvec3> out);

/// The splat of a cell, with fitToSizes().
void splatOfCell(uint64_t node, const CellBody& body, std::span<const float> own,
                 const CellNeighbours& neighbours, NodeSplat& splat, std::span<SplatScalar> values);

/// A half of a splat between two opposite faces, and the faces that it ends at.
struct SlabHalf {
  NodeSplat splat;
  std::vector<SplatScalar> values;
  std::vector<OuterPlane> planes;
};

/// Halves the splat of a cell that ends at two opposite ones of these faces, so that each half ends at one of them: a border code has
/// one face across each axis. Values do not change across. Returns false if there are no such faces.
bool halveSlab(std::span<const OuterPlane> planes, const NodeSplat& whole,
               std::span<const SplatScalar> values, std::array<SlabHalf, 2>& halves);

/// The border code (stream/model/border_code.h) of a splat near these faces, whose order counts in the last
/// bits. `next`: how much longer the splats behind it are, across the face.
uint32_t meshBorderCode(std::span<const OuterPlane> planes, const Splat& splat, double next);

/// Dual cells of outer points are half as thick as those behind them; cells are alike.
inline constexpr double kNextOfPoints = 2, kNextOfCells = 1;

}  // namespace curvisplat
