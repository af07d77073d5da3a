// VTK's cell types as cells of MeshSource.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "preprocess/mesh/mesh_cells.h"

namespace curvisplat {

enum class VtkCellGroup : uint8_t {
  kLinear,
  kCurved,    // quadratic, Lagrange, Bezier: drawn by their corners
  kNotSolid,  // vertices, lines, faces
  kUnknown,
};

VtkCellGroup groupOf(uint8_t type);
inline constexpr uint8_t kVtkPolyhedron = 42;

/// Appends a cell of any type but kVtkPolyhedron; kNone if it has fewer points than its type needs.
void appendVtkCell(uint8_t type, std::span<const uint64_t> points, MeshCells& out);

}  // namespace curvisplat
