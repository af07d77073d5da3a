#include "render/annotate/annotations.h"
#include "render/annotate/canvas.h"

#include <cairo/cairo.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "render/annotate/canvas.h"
#include "render/colour/transfer_function.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr int kColumns = 3, kColumnWidth = 400, kLine = 22, kMargin = 10;
constexpr int kBarBegin = 180, kStripWidth = 200, kStripHeight = 16;
constexpr double kFontSize = 13;

struct Destroy {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
};

/// A heading, or a map with its colours.
struct Entry {
  std::string text;
  bool heading = false;
};

const char* titleOf(MapCategory category) {
  switch (category) {
    case MapCategory::kDiverging:
      return "Diverging";
    case MapCategory::kCyclic:
      return "Cyclic";
    case MapCategory::kSequential:
      break;
  }
  return "Sequential";
}

std::vector<Entry> entries() {
  std::vector<Entry> list;
  for (const auto category : {MapCategory::kSequential, MapCategory::kDiverging, MapCategory::kCyclic}) {
    list.push_back({titleOf(category), true});
    for (const PublishedMap& map : builtInMaps())
      if (map.category == category) list.push_back({std::string(map.name)});
  }
  return list;
}

}  // namespace

Image colourMapSheet() {
  const std::vector<Entry> list = entries();
  const int rows = (static_cast<int>(list.size()) + kColumns - 1) / kColumns;
  const ImageSize size{kColumns * kColumnWidth, rows * kLine + 2 * kMargin};
  const std::unique_ptr<cairo_surface_t, Destroy> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, size.width, size.height));
  const std::unique_ptr<cairo_t, Destroy> cairo(cairo_create(surface.get()));
  if (const cairo_status_t status = cairo_status(cairo.get()); status != CAIRO_STATUS_SUCCESS)
    throw Error("cannot draw the colour maps: {}", cairo_status_to_string(status));
  cairo_set_source_rgb(cairo.get(), 1, 1, 1);
  cairo_paint(cairo.get());
  cairo_set_source_rgb(cairo.get(), 0, 0, 0);
  cairo_set_font_size(cairo.get(), kFontSize);
  const auto cornerOf = [&](size_t n) {
    const auto index = static_cast<int>(n);
    return std::pair(index / rows * kColumnWidth + kMargin, index % rows * kLine + kMargin);
  };
  for (size_t n = 0; n < list.size(); ++n) {
    const auto [x, y] = cornerOf(n);
    selectFont(cairo.get(), list[n].heading ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_move_to(cairo.get(), x, y + kStripHeight - 3);
    cairo_show_text(cairo.get(), list[n].text.c_str());
  }
  cairo_surface_flush(surface.get());

  Image image(size);
  const unsigned char* const bytes = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < size.height; ++y) {
    const auto* const row = reinterpret_cast<const uint32_t*>(bytes + static_cast<ptrdiff_t>(y) * stride);
    for (int x = 0; x < size.width; ++x)
      for (int channel = 0; channel < 3; ++channel)
        image.pixel(x, y)[channel] = static_cast<float>(row[x] >> (16 - 8 * channel) & 255) / 255;
  }
  for (size_t n = 3; n < image.rgba.size(); n += 4) image.rgba[n] = 1;
  for (size_t n = 0; n < list.size(); ++n) {
    if (list[n].heading) continue;
    const TransferFunctionDefinition map = presetDefinition(list[n].text);
    const ColourMap colours(map.colours, map.colour_space);
    const auto [left, top] = cornerOf(n);
    for (int x = 0; x < kStripWidth; ++x) {
      const glm::dvec3 colour = colours.at(static_cast<double>(x) / (kStripWidth - 1));
      for (int y = 0; y < kStripHeight; ++y)
        for (int channel = 0; channel < 3; ++channel)
          image.pixel(left + kBarBegin + x, top + y)[channel] = static_cast<float>(colour[channel]);
    }
  }
  return image;
}

}  // namespace curvisplat
