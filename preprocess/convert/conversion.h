// The passes of a conversion: scan, count, scatter, seams, build, finish. Each leaves in memory and in the
// temporary folder what the next one needs; of those before "build" an interrupted conversion keeps the
// result, so that another goes on there. variablesOf() and manifestOf() say in the manifest what the new
// cache holds. One thread calls; passes are parallel loops.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// Copies what the manifest of a cache says into the report.
void reportCache(const Manifest& written, ConvertReport& report);

/// The nodes, or of an unstructured grid the points or cells, whichever are more.
uint64_t samplesOf(const GridDescription& description);

/// Functions that a conversion calls beside its passes; both may be empty.
struct FurtherParts {
  EstimateNeeds estimate;  // where the disk may be too small
  /// Makes the caches of scalars with blanks of their own, in the folder of the unfinished cache. Before the passes, which
  /// then have the memory for themselves.
  std::function<std::vector<OwnBlanks>(const std::filesystem::path& folder)> own_blanks;
};

/// Runs all passes that are not done yet. What is to be resumed stays when it is stopped, and on an Error if options.resume is
/// set. Throws Error and Interrupted.
ConvertReport runConversion(const DataSource& source, const ConvertOptions& options, const MemoryPlan& plan,
                            std::vector<ConversionFact> facts, const FurtherParts& parts, Progress& progress);

/// The scalars with these numbers in the description, as the cache has them.
std::vector<VariableInfo> variablesOf(const GridDescription& description, std::span<const uint32_t> scalars,
                                      const GridSurvey& survey);

/// The manifest's entries on the grid, its scalars and the time step. Sizes of files and counts of splats
/// and bricks are known only when the files are written.
Manifest manifestOf(const SplatOrigin& origin, const ConvertOptions& options, const ScatteredSplats& splats);

}  // namespace curvisplat
