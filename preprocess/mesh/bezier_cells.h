// Cells of Bezier, whose nodes are control points: the values that their polynomials of Bernstein have at the lattice of their
// parameters (curved_cells.h). There they are the nodes of a Lagrange cell of the same orders. Control points of a rational
// cell are given times their weights, which are a further component. Pure: any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

class BezierCell {
 public:
  BezierCell(CellKind shape, CellCurve curve);

  size_t nodes() const { return nodes_; }
  /// Replaces [node][component] of the control points by what the cell has at its nodes.
  void evaluate(std::vector<double>& values, size_t components) const;

 private:
  /// A node's share of a control point, along some of the axes.
  struct Share {
    uint16_t control;
    double weight;
  };
  struct Pass {
    std::vector<size_t> begin{0};  // [node + 1], in the shares
    std::vector<Share> shares;
  };

  size_t nodes_ = 0;
  std::vector<Pass> passes_;  // along the axes of a hexahedron, along a wedge's triangle and its height
};

/// Made once of each curve. Thread-safe.
const BezierCell& bezierOf(CellKind shape, CellCurve curve);

}  // namespace curvisplat
