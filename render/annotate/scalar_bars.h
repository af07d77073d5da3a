// Scalar bars: the colours of a function, or its opacities, with values beside them, from left to right in a strip at the
// right of the picture.
#pragma once

#include <cairo/cairo.h>

#include <glm/vec3.hpp>
#include <span>

#include "render/annotate/annotated_scene.h"

namespace curvisplat {

/// Of the strip, whole pixels; at most half of the picture. With the font that is set in `cairo`.
double scalarBarsWidth(cairo_t* cairo, ImageSize picture, std::span<const ShownFunction> functions);

void drawScalarBars(cairo_t* cairo, ImageSize picture, std::span<const ShownFunction> functions,
                    const glm::dvec3& ink);

}  // namespace curvisplat
