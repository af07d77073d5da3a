#include "preprocess/formats/vtk/vtk_cell_types.h"

#include <array>
#include <vector>

namespace curvisplat {
namespace {

/// The solid that has the type's corners; kNone: another, or none.
CellKind kindOf(uint8_t type) {
  switch (type) {
    case 10:  // VTK_TETRA
    case 24:  // VTK_QUADRATIC_TETRA
    case 71:  // VTK_LAGRANGE_TETRAHEDRON
    case 78:  // VTK_BEZIER_TETRAHEDRON
      return CellKind::kTetrahedron;
    case 14:  // VTK_PYRAMID
    case 27:  // VTK_QUADRATIC_PYRAMID
    case 37:  // VTK_TRIQUADRATIC_PYRAMID
    case 74:  // VTK_LAGRANGE_PYRAMID
    case 81:  // VTK_BEZIER_PYRAMID
      return CellKind::kPyramid;
    case 13:  // VTK_WEDGE
    case 26:  // VTK_QUADRATIC_WEDGE
    case 31:  // VTK_QUADRATIC_LINEAR_WEDGE
    case 32:  // VTK_BIQUADRATIC_QUADRATIC_WEDGE
    case 73:  // VTK_LAGRANGE_WEDGE
    case 80:  // VTK_BEZIER_WEDGE
      return CellKind::kWedge;
    case 12:  // VTK_HEXAHEDRON
    case 25:  // VTK_QUADRATIC_HEXAHEDRON
    case 29:  // VTK_TRIQUADRATIC_HEXAHEDRON
    case 33:  // VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON
    case 72:  // VTK_LAGRANGE_HEXAHEDRON
    case 79:  // VTK_BEZIER_HEXAHEDRON
      return CellKind::kHexahedron;
    default:
      return CellKind::kNone;
  }
}

/// A prism over a polygon of `sides`; further points are left out.
void appendPrism(size_t sides, std::span<const uint64_t> points, MeshCells& out) {
  if (points.size() < 2 * sides) return out.append(CellKind::kNone, {});
  out.appendPrism(points.first(2 * sides));
}

}  // namespace

VtkCellGroup groupOf(uint8_t type) {
  if ((type >= 10 && type <= 16) || type == kVtkPolyhedron) return VtkCellGroup::kLinear;
  if (kindOf(type) != CellKind::kNone) return VtkCellGroup::kCurved;
  if (type <= 9 || (type >= 21 && type <= 36) || type == 41 || (type >= 51 && type <= 56) ||
      (type >= 60 && type <= 70) || (type >= 75 && type <= 77))
    return VtkCellGroup::kNotSolid;
  return VtkCellGroup::kUnknown;
}

void appendVtkCell(uint8_t type, std::span<const uint64_t> points, MeshCells& out) {
  constexpr uint8_t kVoxel = 11, kPentagonalPrism = 15, kHexagonalPrism = 16;
  if (type == kVoxel && points.size() >= 8) {
    const std::array<uint64_t, 8> round{points[0], points[1], points[3], points[2],
                                        points[4], points[5], points[7], points[6]};
    return out.append(CellKind::kHexahedron, round);
  }
  if (type == kPentagonalPrism) return appendPrism(5, points, out);
  if (type == kHexagonalPrism) return appendPrism(6, points, out);
  out.append(kindOf(type), points);
}

}  // namespace curvisplat
