// `curvisplat convert --dry-run`: what a conversion will take, found by converting a sample of the grid. Nothing is left.
#pragma once

#include <memory>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "tools/options/convert_arguments.h"

namespace curvisplat {

/// Prints bytes, memory and time that convert() of `source` with these options will take, and writes them to --stats. Of
/// unstructured grids by experience, since they are not sampled. Throws what convert() would at its beginning, and
/// Interrupted.
void dryRun(std::unique_ptr<DataSource> source, const ConvertOptions& options,
            const ConvertArguments& arguments);

/// The same of a series: its first two steps are sampled, and further ones are taken to be as the second.
void dryRunOfSeries(const SeriesInput& input, const SeriesOptions& options,
                    const ConvertArguments& arguments);

}  // namespace curvisplat
