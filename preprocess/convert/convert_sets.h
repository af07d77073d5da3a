// Scalars that have values at different samples. A cache has the same samples for all of its own scalars, so that each set of
// scalars with values at the same samples is converted to a cache by itself: those of further sets in the folder of the first
// one's (Manifest::own_blanks). One thread calls.
#pragma once

#include <functional>

#include "preprocess/convert/conversion.h"
#include "preprocess/convert/convert_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Converts options.scalars to one cache: a sample that lacks one of them is blanked, or DifferingBlanks is thrown, as
/// options.differing says. `own_blanks`: FurtherParts::own_blanks.
using ConvertScalars = std::function<ConvertReport(const ConvertOptions& options,
                                                   const decltype(FurtherParts::own_blanks)& own_blanks)>;

/// Converts options.scalars by `convert`, set by set if they have values at different samples. Throws Error as `convert` does.
ConvertReport convertSets(const DataSource& source, const ConvertOptions& options,
                          const ConvertScalars& convert, Progress& progress);

}  // namespace curvisplat
