// A mesh whose cells are cut into halves along each edge: 8 parts of a hexahedron, a wedge and a tetrahedron, 10 of a pyramid. A splat
// has one place and one shape for all of its cell, so that a few cells which differ from those beside them show as bands or dots.
//
// Points are added behind those of the file, where curved cells of order 2 have their nodes (preprocess/mesh/curved_cells.h): one for
// each edge, each face with four corners, and each hexahedron, with the mean of the corners' places and values. Cells that share an
// edge or a face by the numbers of its points share the new point, so thin walls stay walls; those of other pieces get the same bits.
// Where a node of smaller cells hangs in the middle of an edge or a face, it is the point. A new point has no value where a corner has
// none. A cell's value changes within it as towards the cells around its corners, not beyond them, with the cell's mean. Polyhedra,
// and parts of curved cells, which have volumes of their own, stay whole.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// The most cells that are halved, and the most points of a piece: the corners of all new points are in memory, about 300 bytes for
/// each cell, and more while they are found.
inline constexpr uint64_t kMaxHalved = 100'000, kMaxHalvedPoints = 10 * kMaxHalved;

/// Reads all cells once, the points twice or more, and each cell's scalar once before its first use. Samples with `blank_value` have no
/// value. Any number of threads may read the result. Throws Error if there are more than kMaxHalved cells or a piece has more than
/// kMaxHalvedPoints points, or as reading does.
std::unique_ptr<MeshSource> halved(std::unique_ptr<MeshSource> source,
                                   std::optional<double> blank_value = std::nullopt);

/// Whether a picture will show the mesh's cells, so that halving them helps, and costs little: it has up to 30,000 cells, and
/// at the corners of a cell the mean volumes of those around differ by 7 % and more (root mean square, by volume). A uniform medium then
/// deviates by 1.3 to 3 % (rms), and by 0.5 to 2 % once they are halved. Reads all cells of such a small mesh.
bool isHalvedByNeed(const MeshSource& source);

}  // namespace curvisplat
