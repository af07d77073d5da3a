// The axes grid: the box around the data with lines on the sides that lie behind it, and coordinates along three of its
// edges that no data covers.
#pragma once

#include <cairo/cairo.h>

#include <glm/vec3.hpp>

#include "render/annotate/annotated_scene.h"

namespace curvisplat {

/// The lines, which belong behind the data.
void drawAxesGrid(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink);
/// Ticks, coordinates and titles. With the font that is set in `cairo`.
void drawAxesLabels(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink);

}  // namespace curvisplat
