// The first pass of conversion where scalars stand in cells: which cells are there, between which bounds.
#pragma once

#include "preprocess/splats/abutting_faces.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// surveyGrid() for a reader of cell-centred scalars: counts, bounds (of the corners) and ranges are of
/// cells. A cell that has not all of its corners, or no value, is blanked by the grid. Adds the faces of the
/// others at their blocks' ends to `faces`, unless that is null.
GridSurvey surveyCells(const NodeReader& reader, uint64_t slab_bytes, AbuttingFaces* faces,
                       Progress& progress);

}  // namespace curvisplat
