// Moments of the pieces of four cells of one shape at once, a cell in each lane of a vector: the numbers of
// dualMoments() (cell_moments.h), bit for bit, in a third of the time.
#pragma once

#include <cstddef>
#include <span>

#include "preprocess/moments/cell_moments.h"

namespace curvisplat {

inline constexpr size_t kCellsAtOnce = 4;

/// Whether dualMomentsOfFour() takes cells of this shape with that many fields: pyramids, wedges and hexahedra with
/// four fields at the most.
bool isTakenAtOnce(CellKind shape, size_t fields);

/// Overwrites `out`, [cell][corner * momentCount(fields)], with dualMoments() of each of kCellsAtOnce cells, all of
/// one shape that isTakenAtOnce(). Returns false, and leaves `out` undefined, if any of their pieces has no volume:
/// they are to be taken one by one. Pure: any thread. Throws nothing.
bool dualMomentsOfFour(std::span<const CellView> cells, size_t fields, std::span<double> out);

/// Sets bodyOf() of each of kCellsAtOnce cells, all of one shape that isTakenAtOnce(). Pure: any thread. Throws nothing.
void setBodiesOfFour(std::span<const CellView> cells, std::span<CellBody> out);

}  // namespace curvisplat
