#include "render/annotate/annotations.h"

#include <cairo/cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "render/annotate/axis_ticks.h"
#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// A transparent Cairo surface for lines and text, to be composited over an Image.
class Canvas {
 public:
  explicit Canvas(ImageSize size)
      : surface_(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, size.width, size.height)),
        cairo_(cairo_create(surface_.get())) {
    if (const cairo_status_t status = cairo_status(cairo_.get()); status != CAIRO_STATUS_SUCCESS)
      throw Error("cannot annotate an image of {}x{} pixels: {}", size.width, size.height,
                  cairo_status_to_string(status));
    cairo_select_font_face(cairo_.get(), "sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_line_cap(cairo_.get(), CAIRO_LINE_CAP_ROUND);
  }

  cairo_t* get() const { return cairo_.get(); }

  /// Calls `use` with the channels (0..1, premultiplied) of every pixel that is not transparent.
  template <typename Use>
  void forEachPixel(const Use& use) const {
    cairo_surface_flush(surface_.get());
    const unsigned char* const bytes = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
    const int width = cairo_image_surface_get_width(surface_.get());
    const int height = cairo_image_surface_get_height(surface_.get());
    for (int y = 0; y < height; ++y) {
      // Cairo's ARGB32: 32-bit words in the machine's byte order, alpha in the highest byte.
      const auto* const row = reinterpret_cast<const uint32_t*>(bytes + static_cast<ptrdiff_t>(y) * stride);
      for (int x = 0; x < width; ++x) {
        const uint32_t argb = row[x];
        if (argb == 0) continue;
        const auto channel = [&](int shift) { return static_cast<float>(argb >> shift & 255) / 255; };
        use(x, y, glm::vec4(channel(16), channel(8), channel(0), channel(24)));
      }
    }
  }

 private:
  struct Destroy {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
  };
  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> cairo_;
};

glm::dvec3 inkFor(const glm::vec4& background) {
  const glm::dvec3 over_white = glm::dvec3(background) + (1.0 - background.a);
  return glm::dvec3(glm::dot(over_white, glm::dvec3(0.299, 0.587, 0.114)) > 0.5 ? 0.0 : 1.0);
}

void setInk(cairo_t* cairo, const glm::dvec3& rgb, double alpha = 1) {
  cairo_set_source_rgba(cairo, rgb.x, rgb.y, rgb.z, alpha);
}

double fontSize(ImageSize size) {
  return std::clamp(size.height / 42.0, 9.0, 96.0);
}

/// Draws text centred on `centre`.
void drawText(cairo_t* cairo, const glm::dvec2& centre, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(cairo, text.c_str(), &extents);
  cairo_move_to(cairo, centre.x - extents.x_bearing - extents.width / 2,
                centre.y - extents.y_bearing - extents.height / 2);
  cairo_show_text(cairo, text.c_str());
}

// ------------------------------------------------------------------------------------------- outline

/// The projection of the part of a line that is in front of the near plane; nullopt if none is.
std::optional<std::pair<glm::dvec2, glm::dvec2>> lineInImage(const ScreenView& view, glm::dvec3 a,
                                                             glm::dvec3 b) {
  if (view.projection == Projection::kPerspective) {
    if (a.z < view.near && b.z < view.near) return std::nullopt;
    if (a.z < view.near) a += (view.near - a.z) / (b.z - a.z) * (b - a);
    if (b.z < view.near) b += (view.near - b.z) / (a.z - b.z) * (a - b);
  }
  return std::pair{view.pixelFromView(a), view.pixelFromView(b)};
}

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

// ---------------------------------------------------------------------------------------- scalar bar

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
ScalarBar layOutScalarBar(cairo_t* cairo, ImageSize picture, const TransferFunction& function) {
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
  const double wanted = (kBarLeft + kBarWidth + kLabelGap + kTitleGap + kTitleWidth) * font + labels;
  bar.width = std::floor(std::min(wanted, picture.width / 2.0));
  return bar;
}

void drawScalarBar(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const TransferFunction& function = scene.transfer_function;
  const double low = function.range().first, high = function.range().second;
  const bool log_scale = function.logScale();
  const auto fractionOf = [&, low = low, high = high](double scalar) {
    if (!(high > low)) return 0.5;
    return log_scale ? std::log(scalar / low) / std::log(high / low) : (scalar - low) / (high - low);
  };
  const auto scalarAt = [&, low = low, high = high](double fraction) {
    return log_scale ? low * std::pow(high / low, fraction) : low + fraction * (high - low);
  };

  const double font = fontSize(scene.picture);
  const ScalarBar bar = layOutScalarBar(cairo, scene.picture, function);
  const double left = std::floor(scene.picture.width - bar.width + kBarLeft * font);
  const double width = std::floor(kBarWidth * font);
  for (double y = 0; y < bar.height; ++y) {
    setInk(cairo, function.at(scalarAt(1 - (y + 0.5) / bar.height)).colour);
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
  cairo_text_extents(cairo, scene.title.c_str(), &extents);
  cairo_save(cairo);
  cairo_translate(cairo, scene.picture.width - (kTitleWidth - 1) * font, bar.top + bar.height / 2);
  cairo_rotate(cairo, -std::numbers::pi / 2);
  cairo_move_to(cairo, -extents.x_advance / 2, 0);
  cairo_show_text(cairo, scene.title.c_str());
  cairo_restore(cairo);
}

Canvas drawn(const Annotations& annotations, const AnnotatedScene& scene) {
  Canvas canvas(scene.picture);
  cairo_t* const cairo = canvas.get();
  cairo_set_font_size(cairo, fontSize(scene.picture));
  const glm::dvec3 ink = inkFor(scene.background);
  cairo_save(cairo);  // clips axes and outline to the part that shows the data
  cairo_rectangle(cairo, 0, 0, scene.view.size.width, scene.view.size.height);
  cairo_clip(cairo);
  if (annotations.outline) drawOutline(cairo, scene, ink);
  if (annotations.axes) drawAxes(cairo, scene.view, ink);
  cairo_restore(cairo);
  if (annotations.scalar_bar) drawScalarBar(cairo, scene, ink);
  return canvas;
}

}  // namespace

ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function) {
  if (!annotations.scalar_bar) return picture;
  const Canvas ruler({1, 1});
  cairo_set_font_size(ruler.get(), fontSize(picture));
  const double strip = layOutScalarBar(ruler.get(), picture, function).width;
  return {picture.width - static_cast<int>(strip), picture.height};
}

Image annotated(const Image& data, const Annotations& annotations, const AnnotatedScene& scene) {
  CURVISPLAT_CHECK_OP(data.size.width, ==, scene.view.size.width);
  CURVISPLAT_CHECK_OP(data.size.height, ==, scene.picture.height);
  CURVISPLAT_CHECK_OP(data.size.width, <=, scene.picture.width);
  Image picture(scene.picture);
  for (int y = 0; y < picture.size.height; ++y) {
    std::copy_n(data.pixel(0, y), 4 * static_cast<size_t>(data.size.width), picture.pixel(0, y));
    for (int x = data.size.width; x < picture.size.width; ++x)
      for (int c = 0; c < 4; ++c) picture.pixel(x, y)[c] = scene.background[c];
  }
  if (!(annotations == Annotations{}))
    drawn(annotations, scene).forEachPixel([&](int x, int y, const glm::vec4& over) {
      float* const pixel = picture.pixel(x, y);
      for (int c = 0; c < 4; ++c) pixel[c] = over[c] + (1 - over.a) * pixel[c];
    });
  return picture;
}

uint64_t annotatedBytes(ImageSize picture) {
  constexpr uint64_t kPixel = 4 * sizeof(float) + sizeof(uint32_t);  // of an Image and of a Canvas
  return kPixel * picture.pixels();
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

std::string scalarTitle(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

}  // namespace curvisplat
