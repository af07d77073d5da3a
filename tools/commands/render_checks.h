// What can be wrong with the options of `render` together, before a cache is opened; and with the caches of several ranks.
#pragma once

#include "render/image/image_size.h"
#include "stream/base/ranks.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/frame_run.h"

namespace curvisplat {

/// `size`: of the picture. Throws UsageError if options contradict each other, and Error if an output cannot be written.
void checkRenderArguments(const RenderArguments& arguments, ImageSize size);

/// Throws Error at ranks that have opened another cache than rank 0, or another version of it: each draws a share of its own.
void requireSameCache(const CacheReader& cache, Ranks& ranks);

}  // namespace curvisplat
