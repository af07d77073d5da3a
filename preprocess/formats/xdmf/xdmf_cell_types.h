// The types of cells in XDMF, by their numbers in a Mixed topology, or by their names.
#pragma once

#include <cstdint>
#include <string>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// The meaning of a type of a Mixed topology. `counted`: of polygons and the like the number of points comes
/// before them, of polyhedra that of faces, and before each face that of its points.
struct XdmfCellType {
  const char* name;  // of a topology of this type alone, in lower case
  uint64_t number;
  CellKind shape;
  uint64_t nodes;
  bool counted = false;
};
/// Null if there is no such type.
const XdmfCellType* xdmfCellType(uint64_t number);

/// The type that a topology names, in lower case; short forms (tet_10, hex_20) are known, too. Null if there is no such type.
const XdmfCellType* xdmfCellTypeNamed(std::string name);

}  // namespace curvisplat
