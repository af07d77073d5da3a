// The panel beside the picture: what is shown, how finely, and what that costs.
#pragma once

#include <string>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/function_panel.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

/// What the panels tell and do not change.
struct PanelFacts {
  const FrameStatistics* statistics = nullptr;  // of the picture shown; null: there is none
  bool is_final = false;
  bool busy = false;
  bool flies = false;
  std::string backend;
  std::string said;  // the last message: what was saved, what went wrong
};

/// What the user asked for, beyond changing the state.
struct PanelWishes {
  bool changed = false;           // of what the picture shows
  bool function_changed = false;  // of the transfer function; `changed` is true as well
  bool dragging = false;          // something is still being changed: a coarse picture will do
  bool save_picture = false, copy_command = false;
  bool reset_camera = false, other_projection = false, toggle_flight = false;
};

class Panels {
 public:
  explicit Panels(const CacheReader& cache) : cache_(cache), function_(cache) {}

  /// The panels stand at the window's left, this wide: units of Dear ImGui.
  static float width();

  /// Draws them into the present frame of Dear ImGui. `variable`: position of state.variable.
  PanelWishes draw(ViewState& state, size_t variable, const PanelFacts& facts);

 private:
  void drawView(ViewState& state, PanelWishes& wishes, const PanelFacts& facts);
  void drawDetail(ViewState& state, PanelWishes& wishes);
  void drawClipBox(ViewState& state, PanelWishes& wishes);
  void drawStatistics(const ViewState& state, const PanelFacts& facts);

  const CacheReader& cache_;
  FunctionPanel function_;
};

}  // namespace curvisplat
