#include "render/annotate/annotations.h"

#include <cairo/cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "render/annotate/axes_grid.h"
#include "render/annotate/canvas.h"
#include "render/annotate/scalar_bars.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

// ------------------------------------------------------------------------------------------- outline

void drawOutline(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const auto corner = [&](int n) {
    return scene.view.viewFromData({n & 1 ? scene.upper.x : scene.lower.x,
                                    n & 2 ? scene.upper.y : scene.lower.y,
                                    n & 4 ? scene.upper.z : scene.lower.z});
  };
  cairo_set_line_width(cairo, std::max(1.0, fontSize(scene.view.size) / 12));
  setInk(cairo, ink, 0.7);
  for (int from = 0; from < 8; ++from)
    for (const int axis : {1, 2, 4}) {
      if (from & axis) continue;
      const auto line = lineInImage(scene.view, corner(from), corner(from | axis));
      if (!line) continue;
      cairo_move_to(cairo, line->first.x, line->first.y);
      cairo_line_to(cairo, line->second.x, line->second.y);
    }
  cairo_stroke(cairo);
}

// ---------------------------------------------------------------------------------------------- axes

void drawArrow(cairo_t* cairo, const glm::dvec2& from, const glm::dvec2& to, double head) {
  cairo_move_to(cairo, from.x, from.y);
  cairo_line_to(cairo, to.x, to.y);
  cairo_stroke(cairo);
  const glm::dvec2 along = to - from;
  const double length = glm::length(along);
  if (length < head) return;  // it points towards the viewer or away
  const glm::dvec2 unit = along / length, across(-unit.y, unit.x);
  const glm::dvec2 back = to - head * unit;
  const glm::dvec2 left = back + 0.4 * head * across, right = back - 0.4 * head * across;
  cairo_move_to(cairo, to.x, to.y);
  cairo_line_to(cairo, left.x, left.y);
  cairo_line_to(cairo, right.x, right.y);
  cairo_close_path(cairo);
  cairo_fill(cairo);
}

void drawAxes(cairo_t* cairo, const ScreenView& view, const glm::dvec3& ink) {
  const double font = fontSize(view.size), length = 3 * font;
  const glm::dvec2 origin(length + 2 * font, view.size.height - length - 2 * font);
  struct Axis {
    glm::dvec3 in_view;  // right, down, forward
    glm::dvec3 colour;
    const char* name;
  };
  std::array<Axis, 3> axes = {
      {{{}, {0.84, 0.15, 0.16}, "x"}, {{}, {0.17, 0.55, 0.17}, "y"}, {{}, {0.16, 0.36, 0.85}, "z"}}};
  for (int n = 0; n < 3; ++n) axes[n].in_view = {view.right[n], view.down[n], view.forward[n]};
  std::sort(axes.begin(), axes.end(),
            [](const Axis& a, const Axis& b) { return a.in_view.z > b.in_view.z; });  // farthest first
  cairo_set_line_width(cairo, std::max(1.5, font / 6));
  for (const Axis& axis : axes) {
    const glm::dvec2 direction(axis.in_view);
    setInk(cairo, axis.colour);
    drawArrow(cairo, origin, origin + length * direction, 0.6 * font);
    // The name of an axis along the view goes beside the origin, not on it.
    const double shown = glm::length(direction);
    const glm::dvec2 away = shown > 0.2 ? direction / shown : glm::dvec2(-0.7071, 0.7071);
    setInk(cairo, ink);
    drawText(cairo, origin + length * direction + 0.8 * font * away, axis.name);
  }
}

/// `lines`: with the grid's lines, which lie over the data then.
Canvas drawn(const Annotations& annotations, const AnnotatedScene& scene, bool lines) {
  Canvas canvas(scene.picture);
  cairo_t* const cairo = canvas.get();
  cairo_set_font_size(cairo, fontSize(scene.picture));
  const glm::dvec3 ink = inkFor(scene.background);
  cairo_save(cairo);  // clips axes and outline to the part that shows the data
  cairo_rectangle(cairo, 0, 0, scene.view.size.width, scene.view.size.height);
  cairo_clip(cairo);
  if (annotations.outline) drawOutline(cairo, scene, ink);
  if (annotations.axes_grid && lines) drawAxesGrid(cairo, scene, ink);
  if (annotations.axes_grid) drawAxesLabels(cairo, scene, ink);
  if (annotations.axes) drawAxes(cairo, scene.view, ink);
  cairo_restore(cairo);
  if (annotations.scalar_bar) drawScalarBars(cairo, scene.picture, scene.functions, ink);
  return canvas;
}

/// Puts the background, and the grid's lines on it, behind a picture.
void putBehind(Image& picture, const Annotations& annotations, const AnnotatedScene& scene) {
  if (!annotations.axes_grid) {
    const glm::vec4 behind = scene.background;
    for (size_t n = 0; n < picture.rgba.size(); n += 4) {
      const float through = 1 - picture.rgba[n + 3];
      for (size_t c = 0; c < 4; ++c) picture.rgba[n + c] += through * behind[static_cast<int>(c)];
    }
    return;
  }
  Image behind(picture.size);
  for (size_t n = 0; n < behind.rgba.size(); ++n) behind.rgba[n] = scene.background[static_cast<int>(n % 4)];
  Canvas canvas(picture.size);
  drawAxesGrid(canvas.get(), scene, inkFor(scene.background));
  canvas.forEachPixel([&](int x, int y, const glm::vec4& over) {
    float* const pixel = behind.pixel(x, y);
    for (int c = 0; c < 4; ++c) pixel[c] = over[c] + (1 - over.a) * pixel[c];
  });
  for (size_t n = 0; n < picture.rgba.size(); n += 4) {
    const float through = 1 - picture.rgba[n + 3];
    for (size_t c = 0; c < 4; ++c) picture.rgba[n + c] += through * behind.rgba[n + c];
  }
}

}  // namespace

ImageSize dataSize(const Annotations& annotations, ImageSize picture,
                   std::span<const ShownFunction> functions) {
  if (!annotations.scalar_bar) return picture;
  const Canvas ruler({1, 1});
  cairo_set_font_size(ruler.get(), fontSize(picture));
  return {picture.width - static_cast<int>(scalarBarsWidth(ruler.get(), picture, functions)), picture.height};
}

ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function) {
  const ShownFunction shown{&function, {}};
  return dataSize(annotations, picture, {&shown, 1});
}

Image annotated(const Image& data, const Annotations& annotations, const AnnotatedScene& scene) {
  CURVISPLAT_CHECK_OP(data.size.width, ==, scene.view.size.width);
  CURVISPLAT_CHECK_OP(data.size.height, ==, scene.picture.height);
  CURVISPLAT_CHECK_OP(data.size.width, <=, scene.picture.width);
  Image picture(scene.picture);
  for (int y = 0; y < picture.size.height; ++y)
    std::copy_n(data.pixel(0, y), 4 * static_cast<size_t>(data.size.width), picture.pixel(0, y));
  if (annotations.axes_grid || data.size.width < picture.size.width) putBehind(picture, annotations, scene);
  if (!(annotations == Annotations{}))
    drawn(annotations, scene, false).forEachPixel([&](int x, int y, const glm::vec4& over) {
      float* const pixel = picture.pixel(x, y);
      for (int c = 0; c < 4; ++c) pixel[c] = over[c] + (1 - over.a) * pixel[c];
    });
  return picture;
}

uint64_t annotatedBytes(ImageSize picture) {
  // Of two Images and of two Canvases.
  constexpr uint64_t kPixel = 2 * (4 * sizeof(float) + sizeof(uint32_t));
  return kPixel * picture.pixels();
}

std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene) {
  const size_t width = static_cast<size_t>(scene.picture.width);
  std::vector<uint8_t> layer(4 * width * static_cast<size_t>(scene.picture.height), 0);
  if (annotations == Annotations{}) return layer;
  drawn(annotations, scene, true).forEachPixel([&](int x, int y, const glm::vec4& over) {
    uint8_t* const pixel = &layer[4 * (static_cast<size_t>(y) * width + static_cast<size_t>(x))];
    for (int c = 0; c < 3; ++c)
      pixel[c] = static_cast<uint8_t>(std::min(over[c] / over.a, 1.0f) * 255 + 0.5f);
    pixel[3] = static_cast<uint8_t>(over.a * 255 + 0.5f);
  });
  return layer;
}

}  // namespace curvisplat
