#include "render/annotations.h"

#include <cairo/cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render/axis_ticks.h"
#include "stream/error.h"

namespace curvisplat {
namespace {

/// A transparent picture to draw lines and text on with Cairo, and to lay over an Image.
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

  /// Calls `use` with the channels of every pixel that was drawn on, colours multiplied by alpha, 0..1.
  template <typename Use>
  void forEachPixel(const Use& use) const {
    cairo_surface_flush(surface_.get());
    const unsigned char* const bytes = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
    const int width = cairo_image_surface_get_width(surface_.get());
    const int height = cairo_image_surface_get_height(surface_.get());
    for (int y = 0; y < height; ++y) {
      // 32-bit numbers in the machine's byte order: alpha, red, green, blue from the highest byte.
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

/// The text's middle at `centre`.
void drawText(cairo_t* cairo, const glm::dvec2& centre, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(cairo, text.c_str(), &extents);
  cairo_move_to(cairo, centre.x - extents.x_bearing - extents.width / 2,
                centre.y - extents.y_bearing - extents.height / 2);
  cairo_show_text(cairo, text.c_str());
}

// ------------------------------------------------------------------------------------------- outline

/// The part of a line that is in front of the near plane, in the image; nothing if none is.
std::optional<std::pair<glm::dvec2, glm::dvec2>> lineInImage(const ScreenView& view, glm::dvec3 a,
                                                             glm::dvec3 b) {
  if (view.projection == Projection::perspective) {
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
  if (length < head) return;  // it points at the viewer or away
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
    // Of an axis along the view the name goes beside the origin, not on it.
    const double shown = glm::length(direction);
    const glm::dvec2 away = shown > 0.2 ? direction / shown : glm::dvec2(-0.7071, 0.7071);
    setInk(cairo, ink);
    drawText(cairo, origin + length * direction + 0.8 * font * away, axis.name);
  }
}

// ---------------------------------------------------------------------------------------- scalar bar

void drawScalarBar(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const TransferFunction& function = scene.transfer_function;
  const double low = function.range().first, high = function.range().second;
  const bool log_scale = function.logScale();
  const auto fractionOf = [&](double scalar) {
    if (!(high > low)) return 0.5;
    return log_scale ? std::log(scalar / low) / std::log(high / low) : (scalar - low) / (high - low);
  };
  const auto scalarAt = [&](double fraction) {
    return log_scale ? low * std::pow(high / low, fraction) : low + fraction * (high - low);
  };

  const double font = fontSize(scene.view.size);
  const double width = 1.3 * font, height = std::floor(0.6 * scene.view.size.height);
  const std::vector<AxisTick> ticks =
      axisTicks(low, high, std::max(2, static_cast<int>(height / (3 * font))), log_scale);
  const auto extentOf = [&](const std::string& text) {
    cairo_text_extents_t extents;
    cairo_text_extents(cairo, text.c_str(), &extents);
    return extents;
  };
  double label_width = 0;
  for (const AxisTick& tick : ticks) label_width = std::max(label_width, extentOf(tick.label).x_advance);
  const double title_width = extentOf(scene.title).x_advance;
  const double left =
      std::floor(scene.view.size.width - std::max(width + 0.9 * font + label_width, title_width) - font);
  const double top = std::floor((scene.view.size.height - height) / 2);

  for (double y = 0; y < height; ++y) {
    const glm::dvec3 colour = function.at(scalarAt(1 - (y + 0.5) / height)).colour;
    setInk(cairo, colour);
    cairo_rectangle(cairo, left, top + y, width, 1);
    cairo_fill(cairo);
  }
  setInk(cairo, ink);
  cairo_set_line_width(cairo, 1);
  cairo_rectangle(cairo, left - 0.5, top - 0.5, width + 1, height + 1);
  cairo_stroke(cairo);
  for (const AxisTick& tick : ticks) {
    const double y = std::floor(top + height * (1 - fractionOf(tick.value))) + 0.5;
    cairo_move_to(cairo, left + width, y);
    cairo_line_to(cairo, left + width + 0.35 * font, y);
    cairo_stroke(cairo);
    const auto extents = extentOf(tick.label);
    cairo_move_to(cairo, left + width + 0.7 * font, y - extents.y_bearing - extents.height / 2);
    cairo_show_text(cairo, tick.label.c_str());
  }
  cairo_move_to(cairo, left, top - 0.8 * font);
  cairo_show_text(cairo, scene.title.c_str());
}

Canvas drawn(const Annotations& annotations, const AnnotatedScene& scene) {
  Canvas canvas(scene.view.size);
  cairo_t* const cairo = canvas.get();
  cairo_set_font_size(cairo, fontSize(scene.view.size));
  const glm::dvec3 ink = inkFor(scene.background);
  if (annotations.outline) drawOutline(cairo, scene, ink);
  if (annotations.axes) drawAxes(cairo, scene.view, ink);
  if (annotations.scalar_bar) drawScalarBar(cairo, scene, ink);
  return canvas;
}

}  // namespace

void annotate(Image& image, const Annotations& annotations, const AnnotatedScene& scene) {
  CURVISPLAT_CHECK(image.size.width == scene.view.size.width &&
                   image.size.height == scene.view.size.height);
  if (!annotations.any()) return;
  drawn(annotations, scene).forEachPixel([&](int x, int y, const glm::vec4& over) {
    float* const pixel = image.pixel(x, y);
    for (int c = 0; c < 4; ++c) pixel[c] = over[c] + (1 - over.a) * pixel[c];
  });
}

std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene) {
  const size_t width = static_cast<size_t>(scene.view.size.width);
  std::vector<uint8_t> layer(4 * width * static_cast<size_t>(scene.view.size.height), 0);
  if (!annotations.any()) return layer;
  drawn(annotations, scene).forEachPixel([&](int x, int y, const glm::vec4& over) {
    uint8_t* const pixel = &layer[4 * (static_cast<size_t>(y) * width + static_cast<size_t>(x))];
    for (int c = 0; c < 3; ++c) pixel[c] = static_cast<uint8_t>(std::min(over[c] / over.a, 1.0f) * 255 + 0.5f);
    pixel[3] = static_cast<uint8_t>(over.a * 255 + 0.5f);
  });
  return layer;
}

std::string scalarTitle(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

}  // namespace curvisplat
