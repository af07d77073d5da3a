// The axes grid: the box around the data with lines on the sides that lie behind it, and coordinates along three of its
// edges that no data covers. On a globe its sides are bent.
#pragma once

#include <cairo/cairo.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <utility>
#include <vector>

#include "render/annotate/annotated_scene.h"

namespace curvisplat {

/// The lines, which belong behind the data.
void drawAxesGrid(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink);
/// Ticks, coordinates and titles. With the font that is set in `cairo`.
void drawAxesLabels(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink);

/// The same for a box of longitude, latitude and height (AnnotatedScene::on_globe). Data all around the Earth has meridians
/// and circles of latitude on the side that is seen, with coordinates on them.
void drawGlobeGrid(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink);
void drawGlobeLabels(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink);

/// Ticks along an axis at most.
inline constexpr int kMaxTicks = 8;
/// The number of ticks whose coordinates have room along an edge: from 3 to kMaxTicks.
int ticksAlong(double edge_px, double font_px);

/// An edge of a box in the picture, with the coordinates along it.
struct LabelledEdge {
  glm::dvec2 from, middle, to;
  std::vector<std::pair<glm::dvec2, std::string>> ticks;
  std::string title;
  double shortest = 3;  // that has any, in units of the font's size
};
/// Ticks and coordinates at the edge, on the side away from `centre`, where they have room. Nothing of a short one.
void drawEdgeLabels(cairo_t* cairo, const AnnotatedScene& scene, const LabelledEdge& edge,
                    const glm::dvec2& centre);

}  // namespace curvisplat
