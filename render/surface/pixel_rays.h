// The rays of pixels, and what is left of a sheet where one meets it.
#pragma once

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "render/project/clip_planes.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// A direction in stretched space, of length 1. `x`, `y`: a point of the picture.
inline glm::vec3 towardsViewer(const ScreenView& view, float x, float y) {
  if (view.projection != Projection::kPerspective) return glm::vec3(-view.forward);
  const double across = (double{x} - 0.5 * view.size.width) / view.focal_px;
  const double down = (double{y} - 0.5 * view.size.height) / view.focal_px;
  return glm::vec3(-glm::normalize(view.forward + across * view.right + down * view.down));
}

/// The side of a pixel in data coordinates, at a distance along the view.
inline double pixelSide(const ScreenView& view, double distance) {
  return (view.projection == Projection::kPerspective ? distance : 1) / view.focal_px /
         std::max({view.scale.x, view.scale.y, view.scale.z});
}

/// What clip planes leave of a sheet at a point, smoothed over a pixel.
inline float coverageAt(std::span<const ClipPlane> planes, const glm::dvec3& at, double pixel) {
  double coverage = 1;
  for (const ClipPlane& plane : planes)
    coverage *= std::clamp(0.5 + glm::dot(glm::normalize(plane.normal), at - plane.point) / pixel, 0.0, 1.0);
  return static_cast<float>(coverage);
}

}  // namespace curvisplat
