// What lies where a picture's pixels have half of their opacity: depth, scalar and normal. For compositing programs.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "render/image/image.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// Rows from the top. Where there is nothing, the depth is infinite, the scalar NaN and the normal 0.
struct PixelValues {
  ImageSize size;
  std::vector<float> depth;   // from the eye; orthographic: along the view, from the camera's position
  std::vector<float> scalar;  // NaN on surfaces without one
  std::vector<glm::vec3>
      normal;  // towards the viewer, in coordinates after --scale; length 1, or 0 if unknown
};

/// The point in view axes at a depth of a pixel's centre: the inverse of PixelValues::depth.
glm::dvec3 placeOf(const ScreenView& view, int x, int y, double depth);

/// What ValuePainter leaves in an image: depth from `depth_origin`, scalar, and the first two components of the normal
/// in view axes, or kOfLayer where a layer is seen, whose normal is found from its neighbours' depths.
inline constexpr float kOfLayer = 2;
PixelValues pixelValuesOf(const Image& painted, const ScreenView& view, double depth_origin);

}  // namespace curvisplat
