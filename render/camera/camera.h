// A camera, with VTK's and PyVista's names and conventions.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string_view>

#include "render/image/image.h"

namespace curvisplat {

enum class Projection { kOrthographic, kPerspective };

/// The directions of the screen, of unit length.
struct ViewAxes {
  glm::dvec3 right, up, forward;
};

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

  /// The up vector that axes() uses: view_up, or, where it is parallel to the view, (-z, x, y) of it, as in VTK.
  glm::dvec3 usableViewUp() const;

  /// Throws UsageError if position and focal point coincide.
  ViewAxes axes() const;

  /// Right-handed view space: x right, y up, looking along -z; the origin is `position` for both projections.
  /// Throws as axes() does.
  glm::dmat4 viewFromWorld() const;
};

}  // namespace curvisplat
