// The means of drawing annotations: pictures in memory that Cairo draws on (CairoSurface, Canvas), ink, text,
// and lines in space.
//
// Sizes and places are in pixels, from the top left. A surface belongs to one thread at a time, and a Canvas
// takes four bytes a pixel. Cairo is used in this room and in tools/throughput only, whose plots are drawn
// on a CairoSurface, too.
#pragma once

#include <cairo/cairo.h>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "render/image/image.h"
#include "render/project/screen_view.h"
#include "stream/base/error.h"

namespace curvisplat {

/// Chooses the font of texts: the bundle's, where the program is part of one (unless FONTCONFIG_FILE is set), else the system's sans.
/// Any thread.
void selectFont(cairo_t* cairo, cairo_font_weight_t weight = CAIRO_FONT_WEIGHT_NORMAL);

/// A picture in memory, and Cairo's context that draws on it.
class CairoSurface {
 public:
  /// Throws Error if Cairo cannot make one of this size.
  CairoSurface(cairo_format_t format, int width, int height)
      : surface_(cairo_image_surface_create(format, width, height)), cairo_(cairo_create(surface_.get())) {
    if (const cairo_status_t status = cairo_status(cairo_.get()); status != CAIRO_STATUS_SUCCESS)
      throw Error("cannot draw on a picture of {}x{} pixels: {}", width, height,
                  cairo_status_to_string(status));
  }

  cairo_t* cairo() const { return cairo_.get(); }
  /// The surface, with all that was drawn in its pixels.
  cairo_surface_t* flushed() const {
    cairo_surface_flush(surface_.get());
    return surface_.get();
  }

 private:
  struct Destroy {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
  };
  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> cairo_;
};

/// A transparent Cairo surface for lines and text, to be composited over an Image.
class Canvas {
 public:
  explicit Canvas(ImageSize size) : surface_(CAIRO_FORMAT_ARGB32, size.width, size.height) {
    selectFont(get());
    cairo_set_line_cap(get(), CAIRO_LINE_CAP_ROUND);
  }

  cairo_t* get() const { return surface_.cairo(); }

  /// Calls `use` with the channels (0..1, premultiplied) of every pixel, or of those that are not transparent.
  template <bool kAll = false, typename Use>
  void forEachPixel(const Use& use) const {
    cairo_surface_t* const surface = surface_.flushed();
    const unsigned char* const bytes = cairo_image_surface_get_data(surface);
    const int stride = cairo_image_surface_get_stride(surface);
    const int width = cairo_image_surface_get_width(surface);
    const int height = cairo_image_surface_get_height(surface);
    for (int y = 0; y < height; ++y) {
      // Cairo's ARGB32: 32-bit words in the machine's byte order, alpha in the highest byte.
      const auto* const row = reinterpret_cast<const uint32_t*>(bytes + static_cast<ptrdiff_t>(y) * stride);
      for (int x = 0; x < width; ++x) {
        const uint32_t argb = row[x];
        if (!kAll && argb == 0) continue;
        const auto channel = [&](int shift) { return static_cast<float>(argb >> shift & 255) / 255; };
        use(x, y, glm::vec4(channel(16), channel(8), channel(0), channel(24)));
      }
    }
  }

 private:
  CairoSurface surface_;
};

/// Black over light backgrounds, white over dark ones.
inline glm::dvec3 inkFor(const glm::vec4& background) {
  const glm::dvec3 over_white = glm::dvec3(background) + (1.0 - background.a);
  return glm::dvec3(glm::dot(over_white, glm::dvec3(0.299, 0.587, 0.114)) > 0.5 ? 0.0 : 1.0);
}

inline void setInk(cairo_t* cairo, const glm::dvec3& rgb, double alpha = 1) {
  cairo_set_source_rgba(cairo, rgb.x, rgb.y, rgb.z, alpha);
}

/// The font's size in pixels, for a picture of this size. `wanted`: 0 for one that follows the height, or the width of a
/// picture that is narrow, as on a phone: its scalar bar leaves space for the data.
inline double fontSize(ImageSize size, double wanted) {
  return wanted > 0 ? wanted : std::clamp(std::min(size.height / 42.0, size.width / 31.5), 9.0, 96.0);
}

/// Makes the font, which is of this size, smaller where text would be longer than `length`, and returns its size.
inline double fitFont(cairo_t* cairo, double font, const std::string& text, double length) {
  // Again, since glyphs' widths are whole pixels.
  constexpr int kMaxTimes = 8;
  for (int n = 0; n < kMaxTimes; ++n) {
    cairo_set_font_size(cairo, font);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo, text.c_str(), &extents);
    if (!(extents.x_advance > length) || !(length > 0)) break;
    font *= std::min(length / extents.x_advance, 0.97);
  }
  return font;
}

/// Draws text centred on `centre`.
inline void drawText(cairo_t* cairo, const glm::dvec2& centre, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(cairo, text.c_str(), &extents);
  cairo_move_to(cairo, centre.x - extents.x_bearing - extents.width / 2,
                centre.y - extents.y_bearing - extents.height / 2);
  cairo_show_text(cairo, text.c_str());
}

/// Draws text from `at`, the left end of its baseline; on a rim of the other ink, since it lies over the
/// data.
inline void drawOverData(cairo_t* cairo, const glm::dvec2& at, const std::string& text, double font,
                         const glm::dvec3& ink) {
  cairo_move_to(cairo, at.x, at.y);
  cairo_text_path(cairo, text.c_str());
  cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_width(cairo, font / 4);
  setInk(cairo, 1.0 - ink, 0.7);
  cairo_stroke_preserve(cairo);
  setInk(cairo, ink);
  cairo_fill(cairo);
}

/// The projection of the part of a line that is in front of the near plane; nullopt if none is.
inline std::optional<std::pair<glm::dvec2, glm::dvec2>> lineInImage(const ScreenView& view, glm::dvec3 a,
                                                                    glm::dvec3 b) {
  if (view.projection == Projection::kPerspective) {
    if (a.z < view.near && b.z < view.near) return std::nullopt;
    if (a.z < view.near) a += (view.near - a.z) / (b.z - a.z) * (b - a);
    if (b.z < view.near) b += (view.near - b.z) / (a.z - b.z) * (a - b);
  }
  return std::pair{view.pixelFromView(a), view.pixelFromView(b)};
}

}  // namespace curvisplat
