// Where the viewer is, in VTK's and PyVista's words.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string_view>

#include "render/image/image_size.h"

namespace curvisplat {

enum class Projection { kOrthographic, kPerspective };

/// World units; after --scale has been applied to the data.
struct Camera {
  glm::dvec3 position{0, 0, 1};
  glm::dvec3 focal_point{0, 0, 0};
  glm::dvec3 view_up{0, 1, 0};
  Projection projection = Projection::kOrthographic;
  double parallel_scale = 1;   // orthographic: half the image's height, world units
  double view_angle_deg = 30;  // perspective: the angle over the image's height

  /// Looks at the box [lower, upper] from a named direction, all of it in the image with a small margin: iso
  /// (from +x +y +z, z up, as in PyVista), +x, -x, +y, -y (z up), +z, -z (y up); "+x" looks from +x towards
  /// -x. The position is outside the box. Throws UsageError for another name.
  static Camera named(std::string_view view, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size,
                      Projection projection, double view_angle_deg = 30);

  /// The parallel_scale at which this camera, orthographic, has the box [lower, upper] in the image, with the
  /// margin of named().
  double parallelScaleFor(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) const;

  /// The direction that viewFromWorld() takes for up: view_up, or what replaces it.
  glm::dvec3 usableViewUp() const;

  /// Right-handed view space: x right, y up, the viewer looks along -z; for both projections the origin is
  /// `position`. Throws UsageError if position and focal point coincide; an up vector along the view is
  /// replaced as VTK does: (x, y, z) by (-z, x, y).
  glm::dmat4 viewFromWorld() const;
};

}  // namespace curvisplat
