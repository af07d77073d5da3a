// Light on the scalar's level surfaces. A splat's normal is the gradient of its scalar, and the light is
// computed once per splat:
//
//     g = A⁻ᵀ w     strength = |g|² / (|g|² + g0²)
//     diffuse  = 1 - strength + strength (ambient + diffuse |n · l|)      times the colour
//     specular = strength specular |n · h|³²                              white, beside the colour
//
// with n = g/|g|, l towards the light and h half way between l and the viewer. Both sides of a surface are
// lit, hence |.|. Where the scalar hardly changes there is no surface, and the strength goes to 0. The
// threshold g0 is the range of the transfer function divided by the data's diagonal. It does not depend on
// the cells' sizes, so that all levels of detail look alike.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>

#include "render/project/footprint.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// The light of a picture.
struct Light {
  float ambient = 0.3f, diffuse = 0.7f, specular = 0.25f;  // each 0 to 1; ambient + diffuse at most 1
  std::optional<glm::dvec3> towards;  // towards the light, a direction; nullopt: towards the viewer
  // How dark it is where no light arrives, each 0 to 1 (shadow_grid.h). A light at the viewer has no shadows.
  float shadow = 0, ambient_occlusion = 0;

  /// The direction towards a light that casts shadows where none is given.
  static constexpr glm::dvec3 kShadowsFrom{1, -1, 2};
  bool hasShadows() const { return (shadow > 0 && towards) || ambient_occlusion > 0; }
};

/// The factor of a splat's colour, and the amount of white to add; each 0 to 1.
struct Lit {
  float diffuse = 1, specular = 0;
};

/// A light and a view in float, relative to a brick's origin.
class LocalLight {
 public:
  /// `g0` is in the scalar's unit per stretched unit of length, and above 0.
  LocalLight(const Light& light, double g0, const ScreenView& view, const glm::dvec3& origin);

  /// The light on a splat at (x, y, z). Pure.
  Lit of(float x, float y, float z, const Shape& s, const Slope& w) const;

 private:
  const float ambient_, diffuse_, specular_;
  const glm::vec3 scale_, per_scale_;
  const bool perspective_;
  glm::vec3 eye_;  // stretched, from the origin; orthographic: the direction towards the viewer
  glm::vec3 towards_{0};
  const bool at_viewer_;
  const float g0_squared_;
};

/// Packs a half width, which must not be negative, into 15 bits and the light into 16, as a float that is
/// never denormal: the value of ScreenSplat::half_width in lit pictures.
float packLit(float half_width, const Lit& lit);
float unpackHalfWidth(float packed);
Lit unpackLit(float packed);

}  // namespace curvisplat
