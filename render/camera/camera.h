// A camera, with VTK's and PyVista's names and conventions.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string_view>

#include "render/image/image.h"

namespace curvisplat {

enum class Projection { kOrthographic, kPerspective };

/// A camera in world units, after --scale has been applied to the data.
struct Camera {
  glm::dvec3 position{0, 0, 1};
  glm::dvec3 focal_point{0, 0, 0};
  glm::dvec3 view_up{0, 1, 0};
  Projection projection = Projection::kOrthographic;
  double parallel_scale = 1;   // orthographic: half the image's height in world units
  double view_angle_deg = 30;  // perspective: the angle over the image's height

  /// A camera that shows the whole box [lower, upper] with a small margin, from a named direction: iso (from
  /// +x +y +z, z up, as in PyVista), +x, -x, +y, -y (z up), +z, -z (y up). "+x" looks from +x towards -x. The
  /// position is outside the box. Throws UsageError for any other name.
  static Camera named(std::string_view view, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size,
                      Projection projection, double view_angle_deg = 30);

  /// The parallel_scale at which this camera, as an orthographic one, shows the whole box [lower, upper] with
  /// the margin of named().
  double parallelScaleFor(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) const;

  /// Keeps the direction that it looks in, and shows the whole box as named() does: orthographic by the scale,
  /// perspective by the distance from the focal point. The position is outside the box.
  void fit(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

  /// The up vector that viewFromWorld() uses: view_up, or its replacement.
  glm::dvec3 usableViewUp() const;

  /// Right-handed view space: x right, y up, looking along -z; the origin is `position` for both projections.
  /// A view_up parallel to the view is replaced as VTK does: (x, y, z) by (-z, x, y). Throws UsageError if
  /// position and focal point coincide.
  glm::dmat4 viewFromWorld() const;
};

}  // namespace curvisplat
