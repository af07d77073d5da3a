// The isosurfaces of a scene by scalar: what each group's other colours and opacities are of. A picture has a scalar of its opacities and
// perhaps another one of its colours; isosurfaces are of either, or of any further scalar of the cache. All have the picture's colours
// where they lie; those of the scalar that the colours are of have that of their value.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "render/surface/surface_scene.h"

namespace curvisplat {

/// The scalars of a picture.
struct PictureScalars {
  size_t opacities = 0;
  std::optional<size_t> colours = std::nullopt;  // none: they are of the opacities' scalar
};

/// Isosurfaces of one scalar; borrowed from a scene.
struct IsoGroup {
  size_t variable = 0;
  std::optional<size_t> other = std::nullopt;  // a second scalar, which gives them colours or opacities
  bool colours_of_other = false, opacities_of_other = false;
  SheetOpacity opacity = {};
  std::span<const double> values = {};
  std::span<const std::optional<glm::vec3>> own_colours = {};  // as `values`, or empty

  /// The colour that isosurface n was given; nullopt: it has the function's.
  std::optional<glm::vec3> ownColour(size_t n) const {
    return own_colours.empty() ? std::nullopt : own_colours[n];
  }
};

/// The groups of a scene, those of the opacities' scalar first. Opacities by function need the scalar of the opacities: groups of a
/// third scalar, which have the colours of a second one, keep the factor alone.
std::vector<IsoGroup> isoGroups(const SurfaceScene& scene, const PictureScalars& scalars);

}  // namespace curvisplat
