#include "render/annotate/annotations.h"

#include <cairo/cairo.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "render/annotate/annotated_scene.h"
#include "render/annotate/axes_grid.h"
#include "render/annotate/canvas.h"
#include "stream/base/error.h"
#include "stream/base/os.h"

namespace curvisplat {
namespace {

// ------------------------------------------------------------------------------------------- outline

/// Whether the viewer sees a side of the data's box from within: what is on it lies behind the data.
bool isSeenFromWithin(const AnnotatedScene& scene, int axis, bool upper) {
  const ScreenView& view = scene.view;
  if (view.projection != Projection::kPerspective)
    return upper ? view.forward[axis] > 0 : view.forward[axis] < 0;
  const double eye = view.eye[axis] / view.scale[axis];
  return upper ? eye < scene.upper[axis] : eye > scene.lower[axis];
}

/// Draws the edges of the data's box that lie behind the data, or the others.
void drawOutline(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink, bool behind) {
  const auto corner = [&](int n) {
    return scene.view.viewFromData({n & 1 ? scene.upper.x : scene.lower.x,
                                    n & 2 ? scene.upper.y : scene.lower.y,
                                    n & 4 ? scene.upper.z : scene.lower.z});
  };
  cairo_set_line_width(cairo, std::max(1.0, fontSize(scene.view.size, scene.text_size) / 12));
  setInk(cairo, ink, 0.7);
  for (int from = 0; from < 8; ++from)
    for (const int axis : {1, 2, 4}) {
      if (from & axis) continue;
      bool is_behind = true;
      for (int other = 0; other < 3; ++other)
        if (axis != 1 << other) is_behind &= isSeenFromWithin(scene, other, (from & (1 << other)) != 0);
      if (is_behind != behind) continue;
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

/// The places where the arrow of an axis begins and ends and where its name stands, in pixels.
struct AxisArrow {
  glm::dvec2 from, to, name;
};

AxisArrow arrowOf(const AnnotatedScene& scene, int axis) {
  const ScreenView& view = scene.view;
  const double font = fontSize(view.size, scene.text_size), length = 3 * font;
  const glm::dvec2 origin(length + 2 * font, view.size.height - length - 2 * font);
  const glm::dvec2 direction(view.right[axis], view.down[axis]);
  // The name of an axis along the view goes beside the origin, not on it.
  const double shown = glm::length(direction);
  const glm::dvec2 away = shown > 0.2 ? direction / shown : glm::dvec2(-0.7071, 0.7071);
  const glm::dvec2 end = origin + length * direction;
  return {origin, end, end + 0.8 * font * away};
}

void drawAxes(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const double font = fontSize(scene.view.size, scene.text_size);
  struct Axis {
    int number;
    double depth;
    glm::dvec3 colour;
    const char* name;
  };
  std::array<Axis, 3> axes = {
      {{0, 0, {0.84, 0.15, 0.16}, "x"}, {1, 0, {0.17, 0.55, 0.17}, "y"}, {2, 0, {0.16, 0.36, 0.85}, "z"}}};
  for (Axis& axis : axes) axis.depth = scene.view.forward[axis.number];
  std::sort(axes.begin(), axes.end(),
            [](const Axis& a, const Axis& b) { return a.depth > b.depth; });  // farthest first
  cairo_set_line_width(cairo, std::max(1.5, font / 6));
  for (const Axis& axis : axes) {
    const AxisArrow arrow = arrowOf(scene, axis.number);
    setInk(cairo, axis.colour);
    drawArrow(cairo, arrow.from, arrow.to, 0.6 * font);
    setInk(cairo, ink);
    drawText(cairo, arrow.name, axis.name);
  }
}

// --------------------------------------------------------------------------------------- scalar bars
//
// The colours of a function, or its opacities, with values beside them; from left to right in a strip at the
// right of the picture. All texts have the font that is set in `cairo`.

// Offsets from the strip's left edge, in units of the font's size.
constexpr double kBarLeft = 0.6, kBarWidth = 1.3, kLabelGap = 0.7;
constexpr double kCurveWidth = 1.1;  // of opacities, left of the colours
// Offset from its right edge.
constexpr double kTitleWidth = 1.4, kTitleGap = 0.4;
constexpr double kTitleFoot = 0.65;     // below its letters' line: as far from the edge as from the numbers
constexpr double kLongestTitle = 0.96;  // of the picture's height

struct ScalarBar {
  double top, height;  // of the colours
  std::vector<AxisTick> ticks;
  double width;  // of the strip, whole pixels
};

/// Pixels from the strip's left edge. Colours have room for opacities that are not drawn, so that the data does not move when the
/// volume is hidden.
double leftOf(const ShownFunction& shown, double font) {
  return (kBarLeft + (shown.part == ShownFunction::Part::kOpacities ? 0 : kCurveWidth)) * font;
}

double opacityOf(const TransferFunction& function, const TransferFunction::Value& value) {
  return -std::expm1(-value.extinction * function.opacityUnit());
}

ScalarBar layOut(cairo_t* cairo, ImageSize picture, double font, const ShownFunction& shown) {
  ScalarBar bar;
  bar.height = std::floor(0.6 * picture.height);
  bar.top = std::floor((picture.height - bar.height) / 2);
  bar.ticks = axisTicks(shown.function->axis(), std::max(2, static_cast<int>(bar.height / (3 * font))));
  double labels = 0;
  for (const AxisTick& tick : bar.ticks) {
    cairo_text_extents_t extents;
    cairo_text_extents(cairo, tick.label.c_str(), &extents);
    labels = std::max(labels, extents.x_advance);
  }
  // In whole multiples of the font's size, so that the data does not move while an end of the range is
  // dragged.
  labels = std::ceil(labels / font) * font;
  bar.width =
      std::floor(leftOf(shown, font) + (kBarWidth + kLabelGap + kTitleGap + kTitleWidth) * font + labels);
  return bar;
}

/// The colour of the strip: of the colours, or of the opacities as an amount of ink.
glm::dvec3 colourOf(const ShownFunction& shown, double scalar, const glm::dvec3& ink) {
  const TransferFunction::Value value = shown.function->at(scalar);
  if (shown.part != ShownFunction::Part::kOpacities) return value.colour;
  return glm::mix(1.0 - ink, ink, opacityOf(*shown.function, value));
}

/// `right`: where the strip ends.
void drawBar(cairo_t* cairo, const ShownFunction& shown, ImageSize picture, double font, double right,
             const glm::dvec3& ink) {
  const ScalarAxis axis = shown.function->axis();
  const bool is_one_value = !(axis.range.first < axis.range.second);
  const ScalarBar bar = layOut(cairo, picture, font, shown);
  const double left = std::floor(right - bar.width + leftOf(shown, font));
  const double width = std::floor(kBarWidth * font);
  for (double y = 0; y < bar.height; ++y) {
    const double scalar = axis.scalarAt(1 - (y + 0.5) / bar.height);
    setInk(cairo, colourOf(shown, scalar, ink));
    cairo_rectangle(cairo, left, bar.top + y, width, 1);
    cairo_fill(cairo);
    if (shown.part != ShownFunction::Part::kBoth) continue;
    // The square root, as the window's curve: most opacities are small.
    const double length =
        kCurveWidth * font * std::sqrt(opacityOf(*shown.function, shown.function->at(scalar)));
    setInk(cairo, ink, 0.4);
    cairo_rectangle(cairo, left - length, bar.top + y, length, 1);
    cairo_fill(cairo);
  }
  setInk(cairo, ink);
  cairo_set_line_width(cairo, 1);
  cairo_rectangle(cairo, left - 0.5, bar.top - 0.5, width + 1, bar.height + 1);
  cairo_stroke(cairo);
  cairo_text_extents_t extents;
  for (const AxisTick& tick : bar.ticks) {
    const double y =
        std::floor(bar.top + bar.height * (1 - (is_one_value ? 0.5 : axis.fractionOf(tick.value)))) + 0.5;
    cairo_move_to(cairo, left + width, y);
    cairo_line_to(cairo, left + width + kLabelGap * font / 2, y);
    cairo_stroke(cairo);
    cairo_text_extents(cairo, tick.label.c_str(), &extents);
    cairo_move_to(cairo, left + width + kLabelGap * font, y - extents.y_bearing - extents.height / 2);
    cairo_show_text(cairo, tick.label.c_str());
  }
  // The title runs along the bar, from below, so that a long name takes no width.
  cairo_save(cairo);
  fitFont(cairo, font, shown.title, kLongestTitle * picture.height);
  cairo_text_extents(cairo, shown.title.c_str(), &extents);
  cairo_translate(cairo, right - kTitleFoot * font, bar.top + bar.height / 2);
  cairo_rotate(cairo, -std::numbers::pi / 2);
  cairo_move_to(cairo, -extents.x_advance / 2, 0);
  cairo_show_text(cairo, shown.title.c_str());
  cairo_restore(cairo);
}

/// The strip's width in whole pixels; at most half of the picture.
double scalarBarsWidth(cairo_t* cairo, ImageSize picture, double font,
                       std::span<const ShownFunction> functions) {
  double width = 0;
  for (const ShownFunction& shown : functions) width += layOut(cairo, picture, font, shown).width;
  return std::floor(std::min(width, picture.width / 2.0));
}

void drawScalarBars(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const ImageSize picture = scene.picture;
  const double font = fontSize(picture, scene.text_size);
  double right = picture.width - scalarBarsWidth(cairo, picture, font, scene.functions);
  for (const ShownFunction& shown : scene.functions) {
    right = std::min(right + layOut(cairo, picture, font, shown).width, double(picture.width));
    drawBar(cairo, shown, picture, font, right, ink);
  }
}

// --------------------------------------------------------------------------------------- title, label

void drawTexts(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  constexpr double kTitle = 1.4;  // of the font's size
  const double font = fontSize(scene.picture, scene.text_size), width = scene.view.size.width,
               room = width - 2 * font;
  double top = 0.5 * font;
  cairo_save(cairo);
  if (!scene.title.empty()) {
    const double large = fitFont(cairo, kTitle * font, scene.title, room);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo, scene.title.c_str(), &extents);
    top += kTitle * font;
    drawOverData(cairo, {0.5 * (width - extents.x_advance), top}, scene.title, large, ink);
    top += 0.5 * font;
  }
  if (!scene.label.empty()) {
    const double fitted = fitFont(cairo, font, scene.label, room);
    drawOverData(cairo, {font, top + font}, scene.label, fitted, ink);
  }
  cairo_restore(cairo);
}

// ------------------------------------------------------------------------------------------- markers

/// Draws a dot at each point, whatever lies before it, and the text in a dark box beside it, as the window does: at its right, or at its
/// left if it fits only there.
void drawMarkers(cairo_t* cairo, const AnnotatedScene& scene) {
  constexpr glm::dvec3 kLight(1.0), kDark(0.0);
  const ScreenView& view = scene.view;
  const double font = fontSize(scene.picture, scene.text_size), radius = 0.3 * font, margin = 0.2 * font;
  cairo_font_extents_t line;
  cairo_font_extents(cairo, &line);
  for (const MarkerSign& marker : scene.markers) {
    const glm::dvec3 seen = view.viewFromData(marker.point);
    if (view.projection == Projection::kPerspective && seen.z < view.near) continue;
    const glm::dvec2 at = view.pixelFromView(seen);
    if (!(at.x >= 0 && at.x <= view.size.width && at.y >= 0 && at.y <= view.size.height)) continue;
    for (const auto& [ink, part] : {std::pair(kDark, 1.0), {kLight, 0.7}}) {
      setInk(cairo, ink);
      cairo_arc(cairo, at.x, at.y, part * radius, 0, 2 * std::numbers::pi);
      cairo_fill(cairo);
    }
    if (marker.text.empty()) continue;
    cairo_text_extents_t text;
    cairo_text_extents(cairo, marker.text.c_str(), &text);
    const double height = line.ascent + line.descent, width = text.x_advance + 2 * margin,
                 away = 1.5 * radius;
    const bool at_left = at.x + away + width > view.size.width && at.x - away - width >= 0;
    const double left = at_left ? at.x - away - width : at.x + away, top = at.y - 0.5 * height;
    setInk(cairo, kDark, 0.67);
    cairo_rectangle(cairo, left, top, width, height);
    cairo_fill(cairo);
    setInk(cairo, kLight);
    cairo_move_to(cairo, left + margin, top + line.ascent);
    cairo_show_text(cairo, marker.text.c_str());
  }
}

// -------------------------------------------------------------------------------------- all together

/// Draws what lies over the data and beside it.
Canvas drawn(const Annotations& annotations, const AnnotatedScene& scene) {
  Canvas canvas(scene.picture);
  cairo_t* const cairo = canvas.get();
  cairo_set_font_size(cairo, fontSize(scene.picture, scene.text_size));
  const glm::dvec3 ink = inkFor(scene.background);
  cairo_save(cairo);  // clips axes and outline to the part that shows the data
  cairo_rectangle(cairo, 0, 0, scene.view.size.width, scene.view.size.height);
  cairo_clip(cairo);
  if (annotations.outline) drawOutline(cairo, scene, ink, false);
  if (annotations.axes_grid) drawAxesLabels(cairo, scene, ink);
  if (annotations.axes) drawAxes(cairo, scene, ink);
  if (annotations.markers) drawMarkers(cairo, scene);
  if (annotations.texts) drawTexts(cairo, scene, ink);
  cairo_restore(cairo);
  if (annotations.scalar_bar) drawScalarBars(cairo, scene, ink);
  return canvas;
}

}  // namespace

void putBehind(Image& picture, const Annotations& annotations, const AnnotatedScene& scene) {
  const glm::vec4 background = scene.background;
  const auto put = [](float* pixel, const glm::vec4& behind) {
    const float through = 1 - pixel[3];
    for (int c = 0; c < 4; ++c) pixel[c] += through * behind[c];
  };
  if (!annotations.lieBehind()) {
    for (size_t n = 0; n < picture.rgba.size(); n += 4) put(&picture.rgba[n], background);
    return;
  }
  Canvas canvas(picture.size);
  const glm::dvec3 ink = inkFor(background);
  cairo_t* const cairo = canvas.get();
  cairo_rectangle(cairo, 0, 0, scene.view.size.width, scene.view.size.height);
  cairo_clip(cairo);
  if (annotations.axes_grid) drawAxesGrid(cairo, scene, ink);
  if (annotations.outline) drawOutline(cairo, scene, ink, true);
  canvas.forEachPixel<true>([&](int x, int y, const glm::vec4& over) {
    put(picture.pixel(x, y), over + (1 - over.a) * background);
  });
}

namespace {

/// The data with clear pixels at their right. Pages of what has been copied go back to the system at once: two large pictures would
/// need the memory twice.
Image widened(Image data, ImageSize size) {
  constexpr size_t kPage = 4096, kAtOnce = size_t{1} << 20;
  Image wide;
  wide.size = size;
  wide.rgba.reserve(4 * size.pixels());
  auto* const begin = reinterpret_cast<std::byte*>(data.rgba.data());
  size_t given_back = (kPage - reinterpret_cast<uintptr_t>(begin) % kPage) % kPage;  // the first whole page
  const size_t row = 4 * static_cast<size_t>(data.size.width);
  for (int y = 0; y < size.height; ++y) {
    const float* const from = data.pixel(0, y);
    wide.rgba.insert(wide.rgba.end(), from, from + row);
    wide.rgba.resize(4 * static_cast<size_t>(y + 1) * static_cast<size_t>(size.width));
    const size_t copied = static_cast<size_t>(y + 1) * row * sizeof(float);
    if (copied < given_back + kAtOnce) continue;
    const size_t bytes = (copied - given_back) / kPage * kPage;
    os::discardPages(begin + given_back, bytes);
    given_back += bytes;
  }
  return wide;
}

}  // namespace

std::array<glm::dvec2, 3> axisNames(const AnnotatedScene& scene) {
  return {arrowOf(scene, 0).name, arrowOf(scene, 1).name, arrowOf(scene, 2).name};
}

bool hasAnnotations() {
  return true;
}

ImageSize dataSize(const Annotations& annotations, ImageSize picture,
                   std::span<const ShownFunction> functions) {
  if (!annotations.scalar_bar) return picture;
  const Canvas ruler({1, 1});
  const double font = fontSize(picture, annotations.text_size);
  cairo_set_font_size(ruler.get(), font);
  return {picture.width - static_cast<int>(scalarBarsWidth(ruler.get(), picture, font, functions)),
          picture.height};
}

ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function) {
  const ShownFunction shown{&function, {}, ShownFunction::Part::kBoth};
  return dataSize(annotations, picture, {&shown, 1});
}

Image annotated(Image data, const Annotations& annotations, const AnnotatedScene& scene) {
  CURVISPLAT_CHECK_OP(data.size.width, ==, scene.view.size.width);
  CURVISPLAT_CHECK_OP(data.size.height, ==, scene.picture.height);
  CURVISPLAT_CHECK_OP(data.size.width, <=, scene.picture.width);
  const bool is_narrower = data.size.width < scene.picture.width;
  Image picture;
  if (is_narrower) {
    picture = widened(std::move(data), scene.picture);
  } else {
    picture = std::move(data);
  }
  if (annotations.lieBehind() || is_narrower) putBehind(picture, annotations, scene);
  if (!(annotations == Annotations{}))
    drawn(annotations, scene).forEachPixel([&](int x, int y, const glm::vec4& over) {
      float* const pixel = picture.pixel(x, y);
      for (int c = 0; c < 4; ++c) pixel[c] = over[c] + (1 - over.a) * pixel[c];
    });
  return picture;
}

uint64_t annotatedBytes(ImageSize picture, ImageSize data) {
  // Bytes of the Image's further pixels, and of a Canvas.
  return 4 * sizeof(float) * (picture.pixels() - data.pixels()) + sizeof(uint32_t) * picture.pixels();
}

std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene) {
  const size_t width = static_cast<size_t>(scene.picture.width);
  std::vector<uint8_t> layer(4 * width * static_cast<size_t>(scene.picture.height), 0);
  if (annotations == Annotations{}) return layer;
  drawn(annotations, scene).forEachPixel([&](int x, int y, const glm::vec4& over) {
    uint8_t* const pixel = &layer[4 * (static_cast<size_t>(y) * width + static_cast<size_t>(x))];
    for (int c = 0; c < 3; ++c)
      pixel[c] = static_cast<uint8_t>(std::min(over[c] / over.a, 1.0f) * 255 + 0.5f);
    pixel[3] = static_cast<uint8_t>(over.a * 255 + 0.5f);
  });
  return layer;
}

}  // namespace curvisplat
