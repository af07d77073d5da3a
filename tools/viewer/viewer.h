// The window: what is opened in it, its menus, and the main loop.
#pragma once

#include <optional>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/viewer/prepared_view.h"

namespace curvisplat {

/// Opens the window and returns when the user closes it. Checks `stopped` twice a second; once it is stopped,
/// closes the window and throws Interrupted. Throws Error if no window can be opened or the cache cannot be
/// read, and UsageError for a scalar that the cache lacks. Without a cache, the window offers to open one.
void runViewer(std::optional<CacheReader> cache, const ViewerOptions& options, const Progress& stopped);

}  // namespace curvisplat
