// Paints the editor of a transfer function: its curve over the histogram, strips of colours, numbers on both
// axes. For the window's thread, within a frame of Dear ImGui.
#pragma once

#include <imgui.h>

#include <algorithm>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "tools/view/edited_function.h"

namespace curvisplat {

/// Most opacities are small, so the curve shows the square root of the opacity.
float heightOf(double opacity);
double opacityAt(float height);

/// The rectangle of the curve.
struct CurveCanvas {
  ImVec2 lower, size;  // upper left corner

  ImVec2 at(double x, float height) const {
    return {lower.x + static_cast<float>(x) * size.x, lower.y + (1 - height) * size.y};
  }
  double xOf(const ImVec2& mouse) const { return std::clamp((mouse.x - lower.x) / size.x, 0.0f, 1.0f); }
  float heightAt(const ImVec2& mouse) const {
    return std::clamp(1 - (mouse.y - lower.y) / size.y, 0.0f, 1.0f);
  }
};

/// Paints the background and a histogram. Heights are logarithmic over four decades, so that thin layers stay visible
/// beside the far field.
void paintHistogram(const std::vector<double>& histogram, const CurveCanvas& canvas);
/// Paints a line from left to right; `height` gives its height at each x, both from 0 to 1.
void paintLine(const CurveCanvas& canvas, const std::function<float(double)>& height);
/// Paints histogram, curve and points. `marked`: scalars at which a line stands, those of isosurfaces. `has_colours`: the points
/// have those of the function; otherwise they are grey.
void paintCurve(const EditedFunction& function, const std::vector<double>& histogram,
                std::span<const double> marked, const CurveCanvas& canvas, bool has_colours);
/// A strip of colours: `at` gives that of each part, 0..1.
void paintStrip(const ImVec2& lower, const ImVec2& size, const std::function<glm::dvec3(double)>& at);
/// The width of curve, colours and numbers: half a point of the curve's end lies beside it.
float availableWidth();
/// The function's colours, as the next widget.
void paintColours(const EditedFunction& function);
/// Five scalars under the curve or the colours, each below its place.
void paintNumbers(const EditedFunction& function);
/// The width of the opacities beside the curve and of half a point at its end.
float widthOfHeights();
/// Opacities, each beside its height, where no point of the curve lies over it.
void paintHeights(const CurveCanvas& canvas);

}  // namespace curvisplat
