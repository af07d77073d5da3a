// The types of elements in Gmsh's files: how many nodes they have, and in which order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

struct GmshElement {
  size_t nodes = 0;
  CellKind kind = CellKind::kNone;  // kNone: a point, line or face
  std::vector<uint16_t> order;      // [VTK's node]: Gmsh's node, of a cell that is curved; otherwise empty

  bool isCurved() const { return !order.empty(); }
};

/// The element of this type; nullptr if it is not read. Those of higher order are not curved where they lack nodes that the
/// cell of their order has. Any thread.
const GmshElement* gmshElement(int type);

}  // namespace curvisplat
