// The panels of what cuts the data: clip box, clip planes, slices.
#pragma once

#include <cstddef>
#include <optional>
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
  std::optional<size_t> planes_seen_, slices_seen_;  // in the frame before
};

/// A plane in the middle of the data that faces the viewer.
ClipPlane planeBeforeViewer(const Manifest& manifest, const ViewState& state);

}  // namespace curvisplat
