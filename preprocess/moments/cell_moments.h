// Moments of the pieces of a cell: what splats of unstructured grids are made of. DESIGN.md, "Unstructured
// grids".
//
// Each face (its centroid φ, the mean of its corners) and each of its edges (a, b) cut the tetrahedron (a,
// b, φ, c) out of the cell; c is the mean of the cell's corners. Cut in two at the edge's middle m, the
// pieces (a, m, φ, c) belong to a and (b, m, φ, c) to b: together over all cells they are the dual cell of a
// point. Fields are linear in each piece. Volumes count without sign, so cells and faces may go round either
// way; of cells whose corners do not see one another, parts count twice. Four cells of one shape are done at
// once, a cell in each lane of a vector: the same numbers, bit for bit, in a third of the time. Pure: any
// thread.
//
//   moments about an origin, y = x - origin and g = f - f(origin):
//      0     ∫ 1            4-9   ∫ xx xy yy xz yz zz
//      1-3   ∫ x y z        then for each field   ∫ g   ∫ gx gy gz   ∫ gg
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

inline constexpr size_t momentCount(size_t fields) {
  return 10 + 5 * fields;
}

/// A cell with its corners' positions and values, [corner * fields + field].
struct CellView {
  CellKind shape = CellKind::kNone;
  std::span<const glm::dvec3> corners;
  std::span<const float> values;
  std::span<const uint32_t> faces;  // of a polyhedron: MeshCells::faces
};

/// Scratch memory of dualMoments(); keeps its capacity.
struct DualScratch {
  std::vector<glm::dvec3> at;
  std::vector<double> values, of_face, sums;
};

/// Adds nothing: overwrites `out`, [corner * momentCount(fields)], with the moments of what the cell gives
/// to each of its corners, about that corner and its values. Throws nothing but bad_alloc.
void dualMoments(const CellView& cell, size_t fields, DualScratch& scratch, std::span<double> out);

/// A cell as one splat: its volume (no sign), centroid, and 12 times its covariance.
struct CellBody {
  double volume = 0;
  glm::dvec3 centre{0.0};
  double xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;
};

/// The volume, centre and covariance of a cell. If it has no volume, its centre is the mean of its corners,
/// and the covariance 0.
CellBody bodyOf(const CellView& cell);
/// The body from the moments 0 to 9 of the whole cell about `middle`, the mean of its corners.
CellBody bodyFrom(const glm::dvec3& middle, std::span<const double, 10> moments);

/// Cells that dualMomentsOfFour() and setBodiesOfFour() take at once.
inline constexpr size_t kCellsAtOnce = 4;

/// Whether dualMomentsOfFour() takes cells of this shape with that many fields: pyramids, wedges and
/// hexahedra with four fields at the most.
bool isTakenAtOnce(CellKind shape, size_t fields);

/// Overwrites `out`, [cell][corner * momentCount(fields)], with dualMoments() of each of kCellsAtOnce cells,
/// all of one shape that isTakenAtOnce(). Returns false, and leaves `out` undefined, if any of their pieces
/// has no volume: they are to be taken one by one. Throws nothing.
bool dualMomentsOfFour(std::span<const CellView> cells, size_t fields, std::span<double> out);

/// Sets bodyOf() of each of kCellsAtOnce cells, all of one shape that isTakenAtOnce(). Throws nothing.
void setBodiesOfFour(std::span<const CellView> cells, std::span<CellBody> out);

}  // namespace curvisplat
