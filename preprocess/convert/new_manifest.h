// What the manifest of a new cache says of the grid, its scalars and the time step.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/scattered_splats.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// The scalars with these numbers in the description, as the cache has them.
std::vector<VariableInfo> variablesOf(const GridDescription& description, std::span<const uint32_t> scalars,
                                      const GridSurvey& survey);

/// All but what is known when the files are written: their sizes, and the counts of splats and bricks.
Manifest manifestOf(const SplatOrigin& origin, const ConvertOptions& options, const ScatteredSplats& splats);

}  // namespace curvisplat
