// The panels of what is opaque in the volume, or drawn in its place: faces of the grid, surfaces of files, isosurfaces.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/panel_actions.h"
#include "tools/viewer/view_state.h"

namespace curvisplat {

class SurfacePanel {
 public:
  explicit SurfacePanel(const CacheReader& cache) : cache_(cache) {}
  /// `faces`: names of faces that can be added.
  void draw(ViewState& state, const std::vector<std::string>& faces, PanelActions& actions);

 private:
  void drawSurfaces(ViewState& state, const std::vector<std::string>& faces, PanelActions& actions);
  void drawColouring(const ViewState& state, PanelActions& actions);
  void drawIsosurfaces(ViewState& state, PanelActions& actions);

  const CacheReader& cache_;
  std::optional<size_t> surfaces_seen_, isovalues_seen_;  // in the frame before
};

}  // namespace curvisplat
