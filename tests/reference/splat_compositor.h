// The specification of the painters: screen splats drawn one after the other in double precision, with the
// footprint and the classification evaluated, not looked up. Slow, and right. Also what tests of painters
// draw: transfer functions, splats of all shapes and layers, each from a seed; and setSplat(), which sets
// splats of double precision into the arrays that are projected.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/image/image.h"
#include "render/project/painter.h"
#include "render/project/screen_splat.h"
#include "stream/model/splats.h"

namespace curvisplat {

struct SplatArrays {
  SplatGeometry& geometry;
  SplatVariable& variable;
};

/// Sets splat `n`; `position` is from the arrays' origin.
inline void setSplat(const SplatArrays& arrays, size_t n, const glm::dvec3& position, const Splat& splat,
                     const SplatScalar& scalar, SplatCodes codes = {}) {
  const auto& [geometry, variable] = arrays;
  geometry.x[n] = static_cast<float>(position.x);
  geometry.y[n] = static_cast<float>(position.y);
  geometry.z[n] = static_cast<float>(position.z);
  geometry.axis0[n] = static_cast<float>(splat.axis[0]);
  geometry.axis1[n] = static_cast<float>(splat.axis[1]);
  geometry.axis2[n] = static_cast<float>(splat.axis[2]);
  geometry.shear10[n] = static_cast<float>(splat.shear[0]);
  geometry.shear20[n] = static_cast<float>(splat.shear[1]);
  geometry.shear21[n] = static_cast<float>(splat.shear[2]);
  geometry.weight[n] = static_cast<float>(splat.weight);
  geometry.border_code[n] = codes.border;
  geometry.growth_code[n] = codes.growth;
  variable.mean[n] = static_cast<float>(scalar.mean);
  variable.slope0[n] = static_cast<float>(scalar.slope.x);
  variable.slope1[n] = static_cast<float>(scalar.slope.y);
  variable.slope2[n] = static_cast<float>(scalar.slope.z);
  variable.variance[n] = static_cast<float>(scalar.variance);
}

/// Blends `splats` over `background` (premultiplied) in their order.
Image compositeSplats(std::span<const ScreenSplat> splats, const ClassificationTable& table,
                      PixelShading shading, ImageSize size, const glm::vec4& background);

/// Colours and extinction that change with the scalar, and a jump.
ClassificationTable lively(bool log_scale = false);

/// A table without a jump: straight lines fit.
ClassificationTable smooth(bool log_scale = false);

/// Round, lean and thin ones, every other one skewed. Some lie outside of the image, some are larger than it, some much thinner than
/// a pixel.
std::vector<ScreenSplat> randomSplats(int count, uint32_t seed, ImageSize size, float slope = 0.3f,
                                      float opacity = 0.5f);

/// The same splats in their order, every third of them cut at up to three faces.
std::vector<ScreenSplat> cutSome(const std::vector<ScreenSplat>& splats, uint32_t seed);

/// The same splats in their order, two in three of them somewhere along the ray, near depths 0 to 1; some of
/// those are cut as well.
std::vector<ScreenSplat> placeSome(const std::vector<ScreenSplat>& splats, uint32_t seed);
/// Up to five layers a pixel, at depths from 0 to 1, some of them opaque; none in some tiles.
PixelLayers randomLayers(ImageSize size, uint32_t seed);

/// The same splats in their order, each with light of its own.
std::vector<ScreenSplat> lit(std::vector<ScreenSplat> splats, uint32_t seed);

/// Returns the same splats in their order. Most of them are thicker, and their scalar changes along the ray: they hide
/// what is farther of themselves.
std::vector<ScreenSplat> hidingSome(std::vector<ScreenSplat> splats, uint32_t seed);

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

/// The largest difference of any channel of any pixel; infinite where `a` is not finite.
double largestDifference(const Image& a, const Image& b);

}  // namespace curvisplat
