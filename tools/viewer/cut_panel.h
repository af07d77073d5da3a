// The panels of what cuts the data: clip box, clip planes, slices.
#pragma once

#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/panel_actions.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

class CutPanel {
 public:
  explicit CutPanel(const CacheReader& cache) : cache_(cache) {}
  void draw(ViewState& state, PanelActions& actions);

 private:
  void drawClipBox(ViewState& state, PanelActions& actions);
  void drawSlices(ViewState& state, PanelActions& actions);
  void drawPlanes(std::vector<ClipPlane>& planes, size_t most, const ViewState& state, PanelActions& actions);

  const CacheReader& cache_;
  size_t planes_seen_ = 0, slices_seen_ = 0;  // in the frame before
};

/// A plane in the middle of the data that faces the viewer.
ClipPlane planeBeforeViewer(const Manifest& manifest, const ViewState& state);

}  // namespace curvisplat
