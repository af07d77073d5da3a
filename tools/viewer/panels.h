// The panels beside the picture: time, scalars and their functions, picture, cuts, views, markers, statistics. Nothing in
// them changes its size while it is used: what does not apply is greyed out.
#pragma once

#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/cut_panel.h"
#include "tools/viewer/function_panel.h"
#include "tools/viewer/further_scalar_list.h"
#include "tools/viewer/panel_actions.h"
#include "tools/viewer/playback.h"
#include "tools/viewer/statistics_panel.h"
#include "tools/viewer/surface_panel.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

/// What the panels display but cannot change.
struct PanelFacts {
  ShownStatistics shown;
  bool flies = false;
  Playback* playback = nullptr;    // of a series; the panels set its speed and loop
  std::vector<std::string> views;  // saved ones, by name
  Rectangle place;                 // of the panels in the window
  const FurtherScalars* further = nullptr;
  const std::vector<std::string>* faces = nullptr;  // that can be added as surfaces
};

class Panels {
 public:
  explicit Panels(const CacheReader& cache)
      : cache_(cache), cuts_(cache), surfaces_(cache), function_(cache), opacity_function_(cache) {}

  /// Width of the panels in Dear ImGui units, for text of this height.
  static float width(float text_height) { return 26 * text_height; }

  /// Draws the panels into the current Dear ImGui frame and applies edits to `state`.
  PanelActions draw(ViewState& state, const PanelFacts& facts);

 private:
  void drawTime(PanelActions& actions, Playback& playback);
  void drawScalars(const ViewState& state, const FurtherScalars* further, PanelActions& actions);
  void drawFunctions(ViewState& state, PanelActions& actions, uint64_t step);
  void drawView(ViewState& state, PanelActions& actions, const PanelFacts& facts);
  void drawSavedViews(PanelActions& actions, const std::vector<std::string>& views);
  void drawPicture(ViewState& state, PanelActions& actions);
  void drawDetail(ViewState& state, PanelActions& actions);

  const CacheReader& cache_;
  CutPanel cuts_;
  SurfacePanel surfaces_;
  FunctionPanel function_, opacity_function_;
  std::string view_name_;
};

}  // namespace curvisplat
