// What can be wrong with the options of `render` together, before a cache is opened.
#pragma once

#include "render/image/image_size.h"
#include "tools/commands/frame_run.h"

namespace curvisplat {

/// `size`: of the picture. Throws UsageError if options contradict each other, and Error if an output cannot be written.
void checkRenderArguments(const RenderArguments& arguments, ImageSize size);

}  // namespace curvisplat
