// The contents of the volume besides splats, pixel by pixel: surfaces and slices, as layers from the nearest
// to the farthest. Each has a depth and a colour. Layers divide the ray of a pixel into windows of depth:
//
//   viewer | window 0 | layer 0 | window 1 | layer 1 | ... behind an opaque layer there is nothing
//
// A splat that meets a layer is cut into its parts in the windows (ScreenDepth). Painters accumulate every
// window on its own; at the end windows and layers are composited front to back. So it does not matter in
// which order splats of different windows are drawn.
//
// Immutable once it is made; any thread. A pixel takes 4 bytes, a layer 24.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <span>
#include <vector>

#include "render/image/image.h"
#include "render/project/tile_set.h"

namespace curvisplat {

/// A surface, slice or isosurface at a pixel.
struct PixelLayer {
  float depth;       // PixelLayers::depthOrigin() away; perspective: from the eye
  glm::vec4 colour;  // premultiplied
  float scalar = std::numeric_limits<float>::quiet_NaN();  // there; NaN: none
};

/// A pixel's colour behind everything: what its windows and layers make of it.
struct PixelResult {
  glm::vec3 colour{0.0f};
  float through = 1;

  void add(const glm::vec3& premultiplied, float transmittance) {
    colour += through * premultiplied;
    through *= transmittance;
  }
};

/// The layers of all pixels of a picture, from the nearest to the farthest.
class PixelLayers {
 public:
  static constexpr int kMaxLayers = 4, kMaxWindows = kMaxLayers + 1;
  static constexpr float kNowhere = std::numeric_limits<float>::infinity();
  static constexpr int kCellSide = 8;  // pixels; of the smallest cells of boundsOver()

  /// The layers of a row of pixels, or of a piece of it, one pixel after the other.
  struct Row {
    std::vector<uint8_t> counts;  // [pixels]
    std::vector<PixelLayer> layers;

    /// Ends a pixel, whose layers are the last that were appended, in any order. Sorts them, leaves out what
    /// is behind an opaque one or clear, and draws what is beyond the fourth at the fourth's depth.
    void endPixel(size_t first_layer);
  };

  /// `rows`: from the top, each whole or in pieces from the left. Parallel on the caller's TBB arena. `depth_origin`: orthographic, the
  /// distance along the view at which depths begin.
  PixelLayers(ImageSize size, std::vector<Row> rows, double depth_origin);

  ImageSize size() const { return size_; }
  double depthOrigin() const { return depth_origin_; }
  std::span<const PixelLayer> at(int x, int y) const {
    const size_t pixel = static_cast<size_t>(y) * static_cast<size_t>(size_.width) + static_cast<size_t>(x);
    return {layers_.data() + begins_[pixel], begins_[pixel + 1] - begins_[pixel]};
  }
  /// The windows of a pixel with these layers.
  static int windowsOf(std::span<const PixelLayer> layers) {
    return static_cast<int>(layers.size()) + (layers.empty() || layers.back().colour.w < 1 ? 1 : 0);
  }
  /// The most of any pixel.
  int windows() const { return windows_; }
  bool empty() const { return layers_.empty(); }
  uint64_t bytes() const;

  /// Depths between which the layers in a box of pixels lie. What is nearer than `nearest` is in window 0
  /// everywhere; what is farther than `hidden` lies behind opaque layers everywhere. Infinite where the box has
  /// no layer, or pixels without an opaque one. It looks at a few cells only, which may be larger than the box.
  struct Bounds {
    float nearest = kNowhere, hidden = -kNowhere;
  };
  Bounds boundsOver(const ScreenBox& box) const;
  /// The bounds of all cells that boundsOver() looks at: row by row, those of kCellSide pixels first, then those of
  /// twice the side, and so on up to one cell.
  std::vector<Bounds> allBounds() const;

 private:
  struct Level {
    int columns, rows;
    std::vector<Bounds> cells;
  };
  void makeLevels();

  ImageSize size_;
  double depth_origin_;
  std::vector<uint32_t> begins_;  // [pixels + 1], into layers_
  std::vector<PixelLayer> layers_;
  std::vector<Level> levels_;  // cells of kCellSide pixels, then twice as large, ...
  int windows_ = 1;
};

}  // namespace curvisplat
