// What tests of painters draw: transfer functions, and splats of all shapes.
#pragma once

#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/image/image.h"
#include "render/project/painter.h"
#include "render/project/screen_splat.h"

namespace curvisplat {

/// Colours and extinction that change with the scalar, and a jump.
ClassificationTable lively(bool log_scale = false);

/// Without a jump: straight lines fit.
ClassificationTable smooth(bool log_scale = false);

/// Round, lean and thin ones, every other one skewed. Some lie outside of the image, some are larger than it, some much thinner than
/// a pixel.
std::vector<ScreenSplat> randomSplats(int count, uint32_t seed, ImageSize size, float slope = 0.3f,
                                      float opacity = 0.5f);

/// The places of `depths`, the largest first; of equal depths the last first.
std::vector<uint32_t> farthestFirst(std::span<const float> depths);
/// The same splats in their order, every third of them cut at up to three faces.
std::vector<ScreenSplat> cutSome(const std::vector<ScreenSplat>& splats, uint32_t seed);

/// The same splats in their order, two in three of them somewhere along the ray, near depths 0 to 1; some of
/// those are cut as well.
std::vector<ScreenSplat> placeSome(const std::vector<ScreenSplat>& splats, uint32_t seed);
/// Up to five layers a pixel, at depths from 0 to 1, some of them opaque; none in some tiles.
PixelLayers randomLayers(ImageSize size, uint32_t seed);

/// The same splats in their order, each with light of its own.
std::vector<ScreenSplat> lit(std::vector<ScreenSplat> splats, uint32_t seed);

/// The same splats in their order, each with a ScreenColour.
std::vector<ScreenSplat> colourAll(const std::vector<ScreenSplat>& splats, uint32_t seed, float slope = 0.3f);

/// A picture before anything is painted.
struct EmptyPicture {
  ImageSize size;
  glm::vec4 background = {1, 1, 1, 1};
};

/// A frame, in the painter's own order. `splats`: farthest first.
Image paintFrame(Painter& painter, std::span<const ScreenSplat> splats, const ClassificationTable& table,
                 PixelShading shading, const EmptyPicture& empty, const PaintResources& resources = {});

/// Of any channel of any pixel; infinite where `a` is not finite.
double largestDifference(const Image& a, const Image& b);

}  // namespace curvisplat
