// Light on surfaces: that of the volume (render/project/light.h) with a strength of 1.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>

#include "render/project/light.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// Points of surfaces, the components of their vectors apart.
struct LitPoints {
  static constexpr size_t kAtOnce = 64;
  using Vectors = std::array<std::array<float, kAtOnce>, 3>;

  alignas(64) Vectors normal;  // in data coordinates, of any length above 0
  Vectors towards_viewer;      // in stretched space, of length 1
  Vectors colour;
};

class SurfaceLight {
 public:
  /// `light`: none: a light where the viewer is.
  SurfaceLight(const std::optional<Light>& light, const ScreenView& view);

  /// `normal` in data coordinates, of any length above 0; `towards_viewer` in stretched space, of length 1.
  glm::vec3 lit(const glm::vec3& colour, const glm::vec3& normal, const glm::vec3& towards_viewer) const;
  /// Lights the colours of the first `count` points, to the same bits.
  void light(LitPoints& points, size_t count) const;

 private:
  template <bool kAtViewer>
  glm::vec3 litBy(const glm::vec3& colour, const glm::vec3& normal, const glm::vec3& towards_viewer) const;
  template <bool kAtViewer>
  void lightBy(LitPoints& points, size_t count) const;

  const Light light_;
  const glm::vec3 per_scale_;
  glm::vec3 towards_{0};
};

}  // namespace curvisplat
