// Cells of higher order: where their nodes are in the cell, and the linear cells into which they are cut.
//
// A complete cell of order n has nodes at the lattice (i, j, k) / n of its parameters: a hexahedron becomes
// n^3 hexahedra, a wedge wedges, a tetrahedron tetrahedra, each with corners at nodes, where its polynomial
// has exactly the positions and values that are stored. A cell with nodes at its corners and the middles of
// its edges (a hexahedron of 20 nodes, a wedge of 15, a pyramid of 13) loses a piece at each corner, and a
// polyhedron of the middles is left. Faces are cut alike from both sides. Nodes are in VTK's order. Pure: any
// thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

inline constexpr size_t kMaxCurveOrder = 10;

/// The orders along the three axes.
std::array<uint8_t, 3> ordersOf(CellCurve curve);

/// The curve of a cell with that many nodes; of order 0 if there is no such one.
CellCurve curveOf(CellKind shape, size_t nodes);

/// (i, j, k) of each node: from 0 to the order. In wedges and tetrahedra i + j (+ k) is the order at most; in
/// a pyramid i and j are the order less k at most. VTK has no pyramids above order 2: their nodes come by layers.
std::vector<std::array<uint8_t, 3>> nodesOf(CellKind shape, CellCurve curve);

/// A linear cell has the nodes of this one in the middles of its edges, of its faces with four corners, and in its own; its parts are
/// half as long.
inline constexpr CellCurve kHalved{.order = 2, .layers = 2};

/// [node behind the corners]: the corners that it is the middle of, in a linear cell. Made once. Thread-safe.
const std::vector<std::vector<uint8_t>>& middlesOf(CellKind shape);

/// Appends a cell with its nodes in VTK's order: one of higher order if it has more of them than corners. If there is no such one, its
/// corners.
void appendCurved(CellKind shape, std::span<const uint64_t> nodes, MeshCells& out);

/// Appends a cell whose nodes Exodus and CGNS have in this order: edges of the sides come before those of the top. Overwrites `nodes`.
void appendCurvedAsExodus(CellKind shape, bool is_cgns, std::span<uint64_t> nodes, MeshCells& out);

/// The linear cells of a curved one.
class CellParts {
 public:
  CellParts(CellKind shape, CellCurve curve);

  size_t size() const { return kinds_.size(); }
  /// Part n of a cell with these nodes.
  void append(size_t n, std::span<const uint64_t> nodes, MeshCells& out) const;

 private:
  void add(CellKind kind, std::span<const uint16_t> corners);
  void cutAtMiddles(CellKind shape);

  std::vector<CellKind> kinds_;
  std::vector<size_t> begin_{0};  // [part + 1], in the nodes
  std::vector<uint16_t>
      corners_;  // nodes; of the polyhedron its faces: of each the number of its nodes, and these
};

/// The parts of all curves, made once. Thread-safe.
const CellParts& partsOf(CellKind shape, CellCurve curve);

}  // namespace curvisplat
