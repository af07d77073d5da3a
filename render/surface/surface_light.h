// Light on surfaces: that of the volume (render/project/light.h) with a strength of 1.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "render/project/light.h"
#include "render/project/screen_view.h"

namespace curvisplat {

class SurfaceLight {
 public:
  /// `light`: none: a light where the viewer is.
  SurfaceLight(const std::optional<Light>& light, const ScreenView& view);

  /// `normal` in data coordinates, of any length above 0; `towards_viewer` in stretched space, of length 1.
  glm::vec3 lit(const glm::vec3& colour, const glm::vec3& normal, const glm::vec3& towards_viewer) const;

 private:
  const Light light_;
  const glm::vec3 per_scale_;
  glm::vec3 towards_{0};
};

}  // namespace curvisplat
