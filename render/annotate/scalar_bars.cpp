#include "render/annotate/scalar_bars.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <numbers>
#include <vector>

#include "render/annotate/axis_ticks.h"
#include "render/annotate/canvas.h"

namespace curvisplat {
namespace {

// Offsets from the strip's left edge, in units of the font's size.
constexpr double kBarLeft = 0.6, kBarWidth = 1.3, kLabelGap = 0.7;
// Offset from its right edge.
constexpr double kTitleWidth = 1.4, kTitleGap = 0.4;

struct ScalarBar {
  double top, height;  // of the colours
  std::vector<AxisTick> ticks;
  double width;  // of the strip, whole pixels
};

/// With the font that is set in `cairo`.
ScalarBar layOut(cairo_t* cairo, ImageSize picture, const TransferFunction& function) {
  const double font = fontSize(picture);
  const auto [low, high] = function.range();
  ScalarBar bar;
  bar.height = std::floor(0.6 * picture.height);
  bar.top = std::floor((picture.height - bar.height) / 2);
  bar.ticks =
      axisTicks(low, high, std::max(2, static_cast<int>(bar.height / (3 * font))), function.logScale());
  double labels = 0;
  for (const AxisTick& tick : bar.ticks) {
    cairo_text_extents_t extents;
    cairo_text_extents(cairo, tick.label.c_str(), &extents);
    labels = std::max(labels, extents.x_advance);
  }
  // In whole multiples of the font's size, so that the data does not move while an end of the range is
  // dragged.
  labels = std::ceil(labels / font) * font;
  bar.width = std::floor((kBarLeft + kBarWidth + kLabelGap + kTitleGap + kTitleWidth) * font + labels);
  return bar;
}

/// Of the colours, or of the opacities: how much ink.
glm::dvec3 colourOf(const ShownFunction& shown, double scalar, const glm::dvec3& ink) {
  const TransferFunction::Value value = shown.function->at(scalar);
  if (!shown.opacities) return value.colour;
  const double opacity = -std::expm1(-value.extinction * shown.function->opacityUnit());
  return glm::mix(1.0 - ink, ink, opacity);
}

/// `right`: where the strip ends.
void drawBar(cairo_t* cairo, const ShownFunction& shown, ImageSize picture, double right,
             const glm::dvec3& ink) {
  const TransferFunction& function = *shown.function;
  const double low = function.range().first, high = function.range().second;
  const bool log_scale = function.logScale();
  const auto fractionOf = [&, low = low, high = high](double scalar) {
    if (!(high > low)) return 0.5;
    return log_scale ? std::log(scalar / low) / std::log(high / low) : (scalar - low) / (high - low);
  };
  const auto scalarAt = [&, low = low, high = high](double fraction) {
    return log_scale ? low * std::pow(high / low, fraction) : low + fraction * (high - low);
  };

  const double font = fontSize(picture);
  const ScalarBar bar = layOut(cairo, picture, function);
  const double left = std::floor(right - bar.width + kBarLeft * font);
  const double width = std::floor(kBarWidth * font);
  for (double y = 0; y < bar.height; ++y) {
    setInk(cairo, colourOf(shown, scalarAt(1 - (y + 0.5) / bar.height), ink));
    cairo_rectangle(cairo, left, bar.top + y, width, 1);
    cairo_fill(cairo);
  }
  setInk(cairo, ink);
  cairo_set_line_width(cairo, 1);
  cairo_rectangle(cairo, left - 0.5, bar.top - 0.5, width + 1, bar.height + 1);
  cairo_stroke(cairo);
  cairo_text_extents_t extents;
  for (const AxisTick& tick : bar.ticks) {
    const double y = std::floor(bar.top + bar.height * (1 - fractionOf(tick.value))) + 0.5;
    cairo_move_to(cairo, left + width, y);
    cairo_line_to(cairo, left + width + kLabelGap * font / 2, y);
    cairo_stroke(cairo);
    cairo_text_extents(cairo, tick.label.c_str(), &extents);
    cairo_move_to(cairo, left + width + kLabelGap * font, y - extents.y_bearing - extents.height / 2);
    cairo_show_text(cairo, tick.label.c_str());
  }
  // The title runs along the bar, from below, so that a long name takes no width.
  cairo_text_extents(cairo, shown.title.c_str(), &extents);
  cairo_save(cairo);
  cairo_translate(cairo, right - (kTitleWidth - 1) * font, bar.top + bar.height / 2);
  cairo_rotate(cairo, -std::numbers::pi / 2);
  cairo_move_to(cairo, -extents.x_advance / 2, 0);
  cairo_show_text(cairo, shown.title.c_str());
  cairo_restore(cairo);
}

}  // namespace

double scalarBarsWidth(cairo_t* cairo, ImageSize picture, std::span<const ShownFunction> functions) {
  double width = 0;
  for (const ShownFunction& shown : functions) width += layOut(cairo, picture, *shown.function).width;
  return std::floor(std::min(width, picture.width / 2.0));
}

void drawScalarBars(cairo_t* cairo, ImageSize picture, std::span<const ShownFunction> functions,
                    const glm::dvec3& ink) {
  double right = picture.width - scalarBarsWidth(cairo, picture, functions);
  for (const ShownFunction& shown : functions) {
    right = std::min(right + layOut(cairo, picture, *shown.function).width, double(picture.width));
    drawBar(cairo, shown, picture, right, ink);
  }
}

}  // namespace curvisplat
