// What the picture took: times, splats, bytes.
#pragma once

#include <string>

#include "render/frame/frame_statistics.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

struct ShownStatistics {
  const FrameStatistics* statistics = nullptr;  // of the shown picture; null if there is none
  bool is_final = false;
  bool busy = false;
  std::string backend;
};

/// "final", "refining", "coarse" or "not yet drawn".
const char* stateOfPicture(const ShownStatistics& shown);

/// Draws a table into the current Dear ImGui window.
void drawStatistics(const ViewState& state, const ShownStatistics& shown);

}  // namespace curvisplat
