// The panels beside the picture: scalar and transfer function, view, detail, cuts, statistics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/function_panel.h"
#include "tools/viewer/playback.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

/// What the panels display but cannot change.
struct PanelFacts {
  const FrameStatistics* statistics = nullptr;  // of the shown picture; null if there is none
  bool is_final = false;
  bool busy = false;
  bool flies = false;
  std::string backend;
  Playback* playback = nullptr;  // of a series; the panels set its speed and loop
  std::string message;           // the last result or error of a user action
};

/// What the user did in the panels.
struct PanelActions {
  bool changed = false;           // the picture must be drawn again
  bool function_changed = false;  // implies `changed`
  bool dragging = false;          // a control is being dragged: a coarse picture suffices
  bool save_picture = false, copy_command = false;
  std::optional<uint64_t> step;  // to go to
  bool toggle_play = false;
  bool reset_camera = false, other_projection = false, toggle_flight = false;
};

class Panels {
 public:
  explicit Panels(const CacheReader& cache) : cache_(cache), function_(cache) {}

  /// Width of the panels, at the left of the window, in Dear ImGui units.
  static float width();

  /// Draws the panels into the current Dear ImGui frame and applies edits to `state`. `variable`: position of
  /// state.variable in the manifest.
  PanelActions draw(ViewState& state, size_t variable, const PanelFacts& facts);

 private:
  void drawTime(PanelActions& actions, Playback& playback);
  void drawView(ViewState& state, PanelActions& actions, const PanelFacts& facts);
  void drawDetail(ViewState& state, PanelActions& actions);
  void drawClipBox(ViewState& state, PanelActions& actions);
  void drawSlices(ViewState& state, PanelActions& actions);
  void drawPlanes(std::vector<ClipPlane>& planes, size_t most, const ViewState& state, PanelActions& actions);
  void drawStatistics(const ViewState& state, const PanelFacts& facts);

  const CacheReader& cache_;
  FunctionPanel function_;
};

}  // namespace curvisplat
