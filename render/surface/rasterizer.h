// Which triangle is seen at each of a pixel's samples, tile by tile.
//
// Vertices are moved to a grid of 1/16 pixel, in which edge functions are exact, in float for small triangles and
// in double for others: triangles that share an edge leave no gap and share no sample. Eight samples a pixel, whose
// mean is its centre. A sample keeps the least (value, triangle), so the result depends neither on the order of the
// triangles nor on threads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/surface/pixel_samples.h"
#include "render/surface/scene_triangles.h"
#include "render/surface/triangle_bins.h"

namespace curvisplat {

/// The samples of one tile: 256 KiB, to be used for many. One thread at a time.
class SampleTile {
 public:
  SampleTile() : samples_(static_cast<size_t>(kSampleTileWidth) * kSampleTileHeight) {}

  /// Draws the triangles that a tile sees; with `before`, of the same tile, those that lie behind what its samples
  /// see. False if nothing is seen: then samples are undefined.
  bool draw(const SceneTriangles& triangles, const TriangleBins& bins, int column, int row,
            const SampleTile* before = nullptr);

  int x0() const { return x0_; }
  int y0() const { return y0_; }
  int x1() const { return x1_; }  // the last pixel
  int y1() const { return y1_; }
  /// A pixel of the picture.
  const PixelSamples& at(int x, int y) const {
    return samples_[static_cast<size_t>(y - y0_) * kSampleTileWidth + static_cast<size_t>(x - x0_)];
  }

 private:
  struct Setup;
  void drawTriangle(const std::array<ScreenVertex, 3>& corners, uint32_t number);
  void drawGuarded(const std::array<ScreenVertex, 3>& corners, uint32_t number);
  void fill(const Setup& setup, uint32_t number);

  int x0_ = 0, y0_ = 0, x1_ = -1, y1_ = -1;
  const SampleTile* before_ = nullptr;  // while it draws
  std::vector<PixelSamples> samples_;   // [kSampleTileHeight][kSampleTileWidth]
};

}  // namespace curvisplat
