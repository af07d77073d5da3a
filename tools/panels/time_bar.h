// The time of a series, under the picture: buttons, a slider, and which step of how many is shown. Edits nothing
// itself. For the window's thread, within a frame.
#pragma once

#include "stream/cache/cache_reader.h"
#include "tools/panels/labels.h"
#include "tools/view/playback.h"
#include "tools/window/window.h"

namespace curvisplat {

/// "3 of 8", or "2.25 of 8" between two steps; counted from 1, as people do.
std::string textOf(const StepPosition& position, uint64_t steps);

/// Draws it at `place`, which is as high as a frame of Dear ImGui's.
void drawTimeBar(const CacheReader& cache, const Playback& playback, const Rectangle& place,
                 PanelActions& actions);

}  // namespace curvisplat
