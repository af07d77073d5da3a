// The layers of pixels that triangles make, from the samples of a row of pixels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/project/pixel_layers.h"
#include "render/surface/rasterizer.h"
#include "render/surface/scene_triangles.h"
#include "render/surface/surface_shader.h"

namespace curvisplat {

/// The layers that the samples of a row of pixels make, from the nearest on.
///
/// Samples of a pixel whose depths hardly differ are one layer. Its triangles are shaded in the middle of
/// their samples: one for those that share a vertex, up to three that do not. The pixels of a row are
/// collected and then shaded together. One thread at a time. Keeps its memory.
class SampledLayers {
 public:
  /// Both outlive it.
  SampledLayers(const SceneTriangles& triangles, const SurfaceShader& shader);

  /// Whether what lies behind a surface may be seen through it.
  bool hasTranslucent() const { return has_translucent_; }

  void clear();
  /// Adds the layers of a pixel's samples. `hidden`: the samples behind something opaque, which are left
  /// out; adds to it.
  void append(const PixelSamples& samples, int x, int y, unsigned& hidden);
  /// Ends a pixel: what is appended next is the next one's.
  void endPixel() { ends_.push_back(unshaded_.size()); }
  /// Shades all samples, after the last pixel.
  void shade();
  /// The layers of a pixel, in the order of append().
  std::span<const PixelLayer> at(size_t pixel) const {
    const size_t begin = pixel > 0 ? ends_[pixel - 1] : 0;
    return std::span(layers_).subspan(begin, ends_[pixel] - begin);
  }

 private:
  /// A sample that sees a triangle.
  struct Seen {
    float value;
    uint32_t number, place;

    bool operator<(const Seen& other) const {
      return value < other.value || (value == other.value && number < other.number);
    }
  };
  struct Unshaded {
    size_t first_spot, spots;
    float x, y;  // the pixel's middle
    float part;  // of the pixel, that it covers
    float depth;
  };

  static std::array<Seen, kSamples> sortedOf(const std::array<Seen, kSamples>& seen, size_t count);
  size_t endOfLayer(const std::array<Seen, kSamples>& seen, size_t begin, size_t count) const;
  void appendLayer(std::span<const Seen> seen, int x, int y, size_t& left, unsigned& hidden);
  size_t appendSpots(std::span<const Seen> seen, float middle_x, float middle_y);
  double pixelOf(float value) const;
  double toleranceOf(const Seen& sample) const;
  void shadeBlock(size_t first, size_t count);

  const SceneTriangles& triangles_;
  const SurfaceShader& shader_;
  const bool has_translucent_;
  std::vector<SurfaceShader::Spot> spots_;
  std::vector<float> samples_;                // [spots]: how many each stands for
  std::vector<SurfaceShader::Point> points_;  // [spots]
  std::vector<Unshaded> unshaded_;
  std::vector<PixelLayer> layers_;  // [unshaded]
  std::vector<size_t> ends_;        // [pixels]
};

}  // namespace curvisplat
