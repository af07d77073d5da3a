// The first pass of conversion where scalars stand in cells: which cells are there, between which bounds.
#pragma once

#include "preprocess/scan.h"

namespace curvisplat {

/// surveyGrid() for a reader of cell-centred scalars: counts, bounds (of the corners) and ranges are of
/// cells. A cell that has not all of its corners, or no value, is blanked by the grid.
GridSurvey surveyCells(const NodeReader& reader, uint64_t slab_bytes, Progress& progress);

}  // namespace curvisplat
