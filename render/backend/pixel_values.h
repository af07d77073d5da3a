// Finds the values where a picture's pixels have half of their opacity: depth, scalar and normal. For
// compositing programs.
//
//   picture, layers -> makeValueBackend: splats are drawn again -> image -> pixelValuesOf -> PixelValues
//
// The second pass draws on the processor, front to back, splat by splat, in vectors
// (render/cpu/half_depths.h), and leaves out what lies behind that depth. All splats must have ScreenDepths:
// the pass is projected with the layers of everywhere(), which lie before everything. The real layers, if
// there are any, take their part of the opacity where their depth is reached. The backend runs on the
// caller's thread and TBB's; the other functions are pure.
#pragma once

#include <glm/vec3.hpp>

#include <memory>
#include <vector>

#include "render/backend/backend.h"
#include "render/image/image.h"
#include "render/project/painter.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// Rows from the top. Where there is nothing, the depth is infinite, the scalar NaN and the normal 0.
struct PixelValues {
  ImageSize size;
  std::vector<float> depth;   // from the eye; orthographic: along the view, from the camera's position
  std::vector<float> scalar;  // NaN on surfaces without one
  // The normal towards the viewer, in coordinates after --scale; length 1, or 0 if unknown.
  std::vector<glm::vec3> normal;
};

/// The point in view axes at a depth of a pixel's centre: the inverse of PixelValues::depth.
glm::dvec3 placeOf(const ScreenView& view, int x, int y, double depth);

/// Takes the values from what the painter of makeValueBackend() leaves in an image: depth from
/// `depth_origin`, scalar, and the first two components of the normal in view axes, or kOfLayer where a
/// layer is seen, whose normal is found from its neighbours' depths.
inline constexpr float kOfLayer = 2;
PixelValues pixelValuesOf(const Image& painted, const ScreenView& view, double depth_origin);

/// The inputs of the painter; borrowed.
struct ValueInputs {
  const Image& picture;       // that has been drawn, over a transparent background: its opacities
  const PixelLayers* layers;  // the real ones; may be null
  const ScreenView& view;
};

/// Layers that make all splats have ScreenDepths.
PixelLayers everywhere(ImageSize size, double depth_origin);

/// The memory in bytes that the backend and the layers of everywhere() take.
uint64_t valueBytes(ImageSize size, const PaintResources& resources);

/// Makes a backend whose painter finds, for each pixel, the depth at which it has half of its opacity and
/// the values at that depth. Its end() returns an image as pixelValuesOf() takes it.
std::unique_ptr<PaintingBackend> makeValueBackend(const ValueInputs& inputs);

}  // namespace curvisplat
