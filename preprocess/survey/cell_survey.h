// The first pass of conversion for cell-centred scalars: number, bounds and ranges of the cells.
#pragma once

#include "preprocess/splats/abutting_faces.h"
#include "preprocess/survey/grid_survey.h"
#include "preprocess/survey/position_sample.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// What a survey fills beside its result; null: not that.
struct SurveyExtras {
  AbuttingFaces* faces = nullptr;  // of cells
  PositionSample* sample = nullptr;
};

/// surveyGrid() (preprocess/convert/scan.h) for a reader of cell-centred scalars. Counts, bounds (of the
/// corners) and ranges refer to cells. A cell with a blanked corner or without a value counts as blanked by
/// the grid. The extra faces are those of all other cells at the ends of their blocks.
GridSurvey surveyCells(const NodeReader& reader, uint64_t slab_bytes, const SurveyExtras& extras,
                       Progress& progress);

}  // namespace curvisplat
