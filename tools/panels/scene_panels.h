// The panels that list what cuts the data (clip box, clip planes, slices) and what is opaque in it or drawn
// in its place (faces of the grid, surfaces of files, isosurfaces). They edit a ViewState and read no file.
// For the window's thread, within a frame.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/panels/labels.h"
#include "tools/view/view_state.h"
#include "tools/window/widgets.h"

namespace curvisplat {

/// Clip box, clip planes and slices.
class CutPanel {
 public:
  explicit CutPanel(const CacheReader& cache) : cache_(cache) {}
  void draw(ViewState& state, PanelActions& actions);

 private:
  void drawClipBox(ViewState& state, PanelActions& actions);
  static void drawSliceOpacity(ViewState& state, PanelActions& actions);
  void drawPlanes(std::vector<ListedPlane>& planes, const ViewState& state, PanelActions& actions);
  void drawPlane(ListedPlane& plane, const std::string& name, const ViewState& state, PanelActions& actions);
  void drawNormal(ListedPlane& plane, const std::string& name, PanelActions& actions);

  const CacheReader& cache_;
  TypedNumbers typed_;
  std::optional<size_t> planes_seen_, slices_seen_;  // in the frame before
};

/// A plane in the middle of the data that faces the viewer.
ClipPlane planeBeforeViewer(const Manifest& manifest, const ViewState& state);

/// Faces of the grid, surfaces of files and isosurfaces.
class SurfacePanel {
 public:
  explicit SurfacePanel(const CacheReader& cache) : cache_(cache) {}
  /// `faces`: names of those that can be added. `further`: scalars besides the cache's; may be null.
  void draw(ViewState& state, const std::vector<std::string>& faces, const FurtherScalars* further,
            PanelActions& actions);

 private:
  void drawSurfaces(ViewState& state, const std::vector<std::string>& faces, const FurtherScalars* further,
                    PanelActions& actions);
  void drawColouring(const ViewState& state, const FurtherScalars* further, PanelActions& actions) const;
  void drawIsosurfaces(ViewState& state, const FurtherScalars* further, PanelActions& actions);
  void chooseScalarOf(size_t number, const Isosurface& one, const FurtherScalars* further,
                      PanelActions& actions) const;
  void drawValueOf(Isosurface& one, const std::string& name, PanelActions& actions);
  static void drawColourOf(Isosurface& one, const std::string& name, const ViewState& state,
                           PanelActions& actions);

  const CacheReader& cache_;
  std::optional<size_t> surfaces_seen_, isosurfaces_seen_;  // in the frame before
};

}  // namespace curvisplat
