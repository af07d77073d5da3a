// What a picture is drawn of. Of one scalar: its function has colours and opacities. Of two: the opacities are one
// scalar's, and so are isosurfaces and light; the colours are the other's, those of slices and surfaces too.
#pragma once

#include <cstddef>
#include <optional>
#include <utility>

#include "render/colour/transfer_function.h"

namespace curvisplat {

struct DrawnScalar {
  size_t variable = 0;  // of the cache
  TransferFunction function;
};

struct DrawnScalars {
  DrawnScalar opacity;
  std::optional<DrawnScalar> colour = std::nullopt;  // none: also the opacity's

  DrawnScalars(size_t variable, const TransferFunction& function) : opacity{variable, function} {}
  DrawnScalars(DrawnScalar of_opacity, DrawnScalar of_colour)
      : opacity(std::move(of_opacity)), colour(std::move(of_colour)) {}

  /// Which of a cache's variables slices show.
  size_t shownVariable() const { return colour ? colour->variable : opacity.variable; }
};

}  // namespace curvisplat
