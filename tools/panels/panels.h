// The panels beside the picture, in tabs: Colour (scalars and their functions), Objects (what is drawn and what cuts it),
// View (camera, what surrounds the data, saved views, detail, statistics) and, of a series, Time. Below them are buttons
// that save the picture, whichever tab is shown. Nothing changes its size while it is used: what does not apply is
// greyed out. They edit a ViewState, and report everything else as PanelActions. For the window's thread, within a
// frame; histograms are read on another one.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/automatic/stored_steps.h"
#include "render/frame/frame_statistics.h"
#include "stream/cache/cache_reader.h"
#include "tools/panels/film_panel.h"
#include "tools/panels/function_panel.h"
#include "tools/panels/gradient_panel.h"
#include "tools/panels/labels.h"
#include "tools/panels/scene_panels.h"
#include "tools/view/background_jobs.h"
#include "tools/view/playback.h"
#include "tools/view/view_state.h"

namespace curvisplat {

/// The costs of the shown picture: times, splats, bytes.
struct ShownStatistics {
  const FrameStatistics* statistics = nullptr;  // of the shown picture; null if there is none
  bool is_final = false;
  bool busy = false;
  std::string backend;
};

/// "final", "refining", "coarse" or "not yet drawn".
const char* stateOfPicture(const ShownStatistics& shown);

/// Draws a table of the statistics into the current Dear ImGui window.
void drawStatistics(const ViewState& state, const ShownStatistics& shown);

/// Facts that the panels display but cannot change.
struct PanelFacts {
  ShownStatistics shown;
  bool flies = false, shows_frames = true;
  Playback* playback = nullptr;    // of a series; the panels set its speed and loop
  std::vector<std::string> views;  // saved ones, by name
  Rectangle place;                 // of the panels in the window
  const FilmEdit* film = nullptr;
  FilmPictures film_pictures;
  const FurtherScalars* further = nullptr;
  const std::vector<std::string>* faces = nullptr;      // that can be added as surfaces
  const std::vector<std::string>* elsewhere = nullptr;  // scalars that have values at other samples
};

class Panels {
 public:
  explicit Panels(const CacheReader& cache)
      : cache_(cache),
        cuts_(cache),
        surfaces_(cache),
        function_(cache),
        opacity_function_(cache),
        gradient_(cache) {}

  /// Width of the panels in Dear ImGui units, for text of this height.
  static float width(float text_height) { return 26 * text_height; }

  /// Draws the panels into the current Dear ImGui frame and applies edits to `state`.
  PanelActions draw(ViewState& state, const PanelFacts& facts);
  /// The film or a saved view has changed the lists of objects: that brings up no tab.
  void forgetObjects() { objects_seen_.reset(); }

 private:
  bool hasMoreObjects(const ViewState& state);
  void drawColour(ViewState& state, const PanelFacts& facts, PanelActions& actions);
  void drawObjects(ViewState& state, const PanelFacts& facts, PanelActions& actions);
  void drawTime(const ViewState& state, PanelActions& actions, Playback& playback);
  void drawScalars(const ViewState& state, const PanelFacts& facts, PanelActions& actions);
  void drawOpacityScalars(const ViewState& state, const PanelFacts& facts, PanelActions& actions);
  void drawFunctions(ViewState& state, PanelActions& actions, uint64_t step);
  void drawFinerThanStored(const ViewState& state, const PanelFacts& facts);
  void drawView(ViewState& state, PanelActions& actions, const PanelFacts& facts);
  void drawSavedViews(PanelActions& actions, const std::vector<std::string>& views);
  void drawDetail(ViewState& state, PanelActions& actions);

  const CacheReader& cache_;
  CutPanel cuts_;
  SurfacePanel surfaces_;
  FunctionPanel function_, opacity_function_;
  GradientPanel gradient_;
  std::optional<std::pair<uint64_t, AskedDifferences>> asked_;  // the step, and what `finer_` answers
  std::vector<std::string> finer_;                              // warnings: finerThanStored()
  std::string view_name_;
  FilmPanel film_;
  std::optional<size_t> objects_seen_, keys_seen_;  // in the frame before
  bool scrolls_ = false;                            // the tab that was shown then
};

}  // namespace curvisplat
