// The passes of a conversion: scan, count, scatter, seams, build, finish. Each leaves in memory and in the temporary folder
// what the next one needs; of those before "build" an interrupted conversion keeps the result, so that another goes on there.
#pragma once

#include <filesystem>
#include <vector>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/disk_check.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// Copies what the manifest of a cache says into the report.
void reportCache(const Manifest& written, ConvertReport& report);

/// Runs all passes that are not done yet. Where the disk may be too small, `estimate` is called first, unless it is empty.
/// What is to be resumed stays when it is stopped, and on an Error if options.resume is set. Throws Error and Interrupted.
ConvertReport runConversion(const DataSource& source, const ConvertOptions& options, const MemoryPlan& plan,
                            std::vector<ConversionFact> facts, const EstimateNeeds& estimate,
                            Progress& progress);

}  // namespace curvisplat
