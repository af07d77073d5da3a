// What the window shows before anything is chosen: the function and the view that `render` chooses.
#pragma once

#include <string>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/edited_function.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

/// The initial state of a window with a picture of this size. `scalar`: a name, or empty for the first that
/// varies. Throws UsageError if there is no such scalar, and Error as reading does.
ViewState firstViewOf(const CacheReader& cache, const std::string& scalar, ImageSize picture);

/// The function that is chosen from the data for a scalar. Reads a coarse level of the cache: 0.1 to 0.3 s.
EditedFunction automaticFunction(const CacheReader& cache, const std::string& scalar);

/// Selects another scalar. An automatic function is chosen anew; another keeps its points over the scalar's
/// range. Throws UsageError that lists the scalars if there is none of this name.
void chooseVariable(ViewState& state, const CacheReader& cache, const std::string& name);

}  // namespace curvisplat
