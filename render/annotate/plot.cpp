#include "render/annotate/plot.h"

#include <cairo/cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "render/annotate/annotated_scene.h"
#include "render/annotate/canvas.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

struct Colour {
  double r, g, b;
};
// Okabe and Ito's palette for colour-blind readers, without its yellow.
constexpr std::array<Colour, 7> kColours{{{0.00, 0.45, 0.70},
                                          {0.84, 0.37, 0.00},
                                          {0.00, 0.62, 0.45},
                                          {0.80, 0.47, 0.65},
                                          {0.34, 0.71, 0.91},
                                          {0.90, 0.62, 0.00},
                                          {0.40, 0.40, 0.40}}};
constexpr Colour kInk{0.13, 0.13, 0.13}, kGrid{0.87, 0.87, 0.87}, kFaint{0.4, 0.4, 0.4};
constexpr double kPixelsPerPoint = 2;  // for high-resolution displays
constexpr double kPanelWidth = 460, kLineHeight = 320, kBarHeight = 19, kLegendHeight = 20;
constexpr size_t kMaxInARow = 3;
constexpr double kFont = 12, kTitleFont = 14;

/// Sizes in points.
class PlotCanvas {
 public:
  PlotCanvas(double width, double height)
      : surface_(CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(kPixelsPerPoint * width)),
                 static_cast<int>(std::ceil(kPixelsPerPoint * height))) {
    cairo_scale(get(), kPixelsPerPoint, kPixelsPerPoint);
    cairo_set_source_rgb(get(), 1, 1, 1);
    cairo_paint(get());
    cairo_set_line_join(get(), CAIRO_LINE_JOIN_ROUND);
  }

  cairo_t* get() const { return surface_.cairo(); }

  void ink(const Colour& colour) { cairo_set_source_rgb(get(), colour.r, colour.g, colour.b); }
  void font(double size, bool bold = false) {
    selectFont(get(), bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(get(), size);
  }
  double widthOf(const std::string& text) const {
    cairo_text_extents_t extents;
    cairo_text_extents(get(), text.c_str(), &extents);
    return extents.x_advance;
  }
  /// `along`: the text begins (0), is centred (0.5) or ends (1) at x. The baseline is at y.
  void text(double x, double y, const std::string& string, double along = 0) {
    cairo_move_to(get(), x - along * widthOf(string), y);
    cairo_show_text(get(), string.c_str());
  }
  void textUpwards(double x, double y, const std::string& string) {
    cairo_save(get());
    cairo_translate(get(), x, y);
    cairo_rotate(get(), -M_PI / 2);
    text(0, 0, string, 0.5);
    cairo_restore(get());
  }
  void line(double x0, double y0, double x1, double y1) {
    cairo_move_to(get(), x0, y0);
    cairo_line_to(get(), x1, y1);
    cairo_stroke(get());
  }

  std::vector<std::byte> png() {
    std::vector<std::byte> bytes;
    const auto append = [](void* to, const unsigned char* from, unsigned count) {
      auto* const all = static_cast<std::vector<std::byte>*>(to);
      all->insert(all->end(), reinterpret_cast<const std::byte*>(from),
                  reinterpret_cast<const std::byte*>(from) + count);
      return CAIRO_STATUS_SUCCESS;
    };
    const cairo_status_t status = cairo_surface_write_to_png_stream(surface_.flushed(), append, &bytes);
    if (status != CAIRO_STATUS_SUCCESS)
      throw Error("cannot write a plot as PNG: {}", cairo_status_to_string(status));
    return bytes;
  }

 private:
  CairoSurface surface_;
};

/// Draws a legend of colour patches and names in rows; with a null canvas only measures. Returns the height.
double drawLegend(PlotCanvas* canvas, double left, double top, double width,
                  const std::vector<std::string>& names, PlotCanvas& measure) {
  double x = left, y = top;
  for (size_t n = 0; n < names.size(); ++n) {
    const double needed = 18 + measure.widthOf(names[n]) + 14;
    if (x > left && x + needed > left + width) {
      x = left;
      y += kLegendHeight;
    }
    if (canvas) {
      canvas->ink(kColours[n % kColours.size()]);
      cairo_rectangle(canvas->get(), x, y + 4, 12, 8);
      cairo_fill(canvas->get());
      canvas->ink(kInk);
      canvas->text(x + 18, y + 12, names[n]);
    }
    x += needed;
  }
  return y - top + kLegendHeight;
}

void drawTitle(PlotCanvas& canvas, double left, double top, const std::string& title) {
  canvas.font(kTitleFont, true);
  canvas.ink(kInk);
  canvas.text(left + 12, top + 24, title);
  canvas.font(kFont);
}

// --------------------------------------------------------------------------------------------- lines

void drawLines(PlotCanvas& canvas, double panel_left, double panel_top, const LinePanel& panel) {
  std::set<double> xs, ys;
  for (const PlotLine& line : panel.lines)
    for (const auto& [x, y] : line.points) {
      xs.insert(x);
      ys.insert(y);
    }
  if (xs.empty()) return;
  double largest = *ys.rbegin() > 0 ? 1.05 * *ys.rbegin() : 1;
  double least = panel.log_values ? 0.8 * *ys.begin() : 0;
  if (panel.is_profile) {
    least = *ys.begin();
    largest = *ys.rbegin();
    const double around =
        largest > least ? 0.05 * (largest - least) : std::max(0.05 * std::abs(largest), 1e-30);
    least -= around;
    largest += around;
  }
  const std::vector<AxisTick> ticks = axisTicks({{least, largest}, panel.log_values}, 5);
  double label_width = 0;
  for (const AxisTick& tick : ticks) label_width = std::max(label_width, canvas.widthOf(tick.label));

  const double left = panel_left + 34 + label_width, right = panel_left + kPanelWidth - 24;
  const double top = panel_top + 8, bottom = panel_top + kLineHeight - 46;
  const auto along = [&](double x) { return panel.is_profile ? x : std::log(x); };
  const double low = along(*xs.begin()), high = along(*xs.rbegin());
  const auto xOf = [&](double x) {
    const double inset = 14;  // keeps the first and last point off the frame
    if (!(high > low)) return (left + right) / 2;
    return left + inset + (along(x) - low) / (high - low) * (right - left - 2 * inset);
  };
  const auto yOf = [&](double y) {
    const double part =
        panel.log_values ? std::log(y / least) / std::log(largest / least) : (y - least) / (largest - least);
    return bottom - part * (bottom - top);
  };

  cairo_set_line_width(canvas.get(), 1);
  for (const AxisTick& tick : ticks) {
    canvas.ink(kGrid);
    canvas.line(left, yOf(tick.value), right, yOf(tick.value));
    canvas.ink(kInk);
    canvas.text(left - 7, yOf(tick.value) + 4, tick.label, 1);
  }
  const auto tickX = [&](double x, const std::string& label) {
    canvas.ink(kFaint);
    canvas.line(xOf(x), bottom, xOf(x), bottom + 4);
    canvas.ink(kInk);
    canvas.text(xOf(x), bottom + 18, label, 0.5);
  };
  if (!panel.is_profile)
    for (const double x : xs) tickX(x, panel.x_label(x));
  else
    for (const AxisTick& tick : axisTicks({{low, high}}, 5)) tickX(tick.value, tick.label);
  canvas.ink(kFaint);
  canvas.line(left, bottom, right, bottom);
  canvas.ink(kInk);
  canvas.text((left + right) / 2, bottom + 38, panel.x_name, 0.5);
  canvas.textUpwards(panel_left + 18, (top + bottom) / 2, panel.y_name);

  for (size_t n = 0; n < panel.lines.size(); ++n) {
    canvas.ink(kColours[n % kColours.size()]);
    cairo_set_line_width(canvas.get(), 2);
    cairo_new_path(canvas.get());
    for (const auto& [x, y] : panel.lines[n].points) cairo_line_to(canvas.get(), xOf(x), yOf(y));
    cairo_stroke(canvas.get());
    if (panel.is_profile) continue;
    for (const auto& [x, y] : panel.lines[n].points) {
      cairo_arc(canvas.get(), xOf(x), yOf(y), 3.2, 0, 2 * M_PI);
      cairo_fill(canvas.get());
    }
  }
}

std::vector<std::string> namesOf(const LinePanel& panel) {
  std::vector<std::string> names;
  if (panel.lines.size() < 2) return names;
  for (const PlotLine& line : panel.lines) names.push_back(line.name);
  return names;
}

// ---------------------------------------------------------------------------------------------- bars

double heightOf(const BarPanel& panel) {
  return kBarHeight * static_cast<double>(panel.bars.size()) + 58;
}

void drawBars(PlotCanvas& canvas, double panel_left, double panel_top, const BarPanel& panel) {
  double largest = 0, label_width = 0, text_width = 0;
  for (const Bar& bar : panel.bars) {
    largest = std::max(largest, bar.value);
    label_width = std::max(label_width, canvas.widthOf(bar.label));
    text_width = std::max(text_width, canvas.widthOf(bar.text));
  }
  if (!(largest > 0)) largest = 1;
  const double left = panel_left + 22 + label_width, right = panel_left + kPanelWidth - 24 - text_width;
  const double top = panel_top + 8, bottom = top + kBarHeight * static_cast<double>(panel.bars.size());
  const auto xOf = [&](double value) { return left + value / largest * (right - left); };

  cairo_set_line_width(canvas.get(), 1);
  for (const AxisTick& tick : axisTicks({{0, largest}}, 4)) {
    canvas.ink(kGrid);
    canvas.line(xOf(tick.value), top - 4, xOf(tick.value), bottom + 2);
    canvas.ink(kInk);
    canvas.text(xOf(tick.value), bottom + 17, tick.label, 0.5);
  }
  canvas.text((left + right) / 2, bottom + 37, panel.x_name, 0.5);
  for (size_t n = 0; n < panel.bars.size(); ++n) {
    const Bar& bar = panel.bars[n];
    const double y = top + kBarHeight * static_cast<double>(n);
    canvas.ink(kColours[bar.colour % kColours.size()]);
    cairo_rectangle(canvas.get(), left, y + 2, xOf(bar.value) - left, kBarHeight - 5);
    cairo_fill(canvas.get());
    canvas.ink(kInk);
    canvas.text(left - 7, y + 13, bar.label, 1);
    canvas.text(xOf(bar.value) + 6, y + 13, bar.text);
  }
  canvas.ink(kFaint);
  canvas.line(left, top - 4, left, bottom + 2);
}

std::vector<std::string> namesOf(const BarPanel& panel) {
  return panel.kinds.size() < 2 ? std::vector<std::string>() : panel.kinds;
}

double heightOf(const LinePanel&) {
  return kLineHeight;
}
void drawBody(PlotCanvas& canvas, double left, double top, const LinePanel& panel) {
  drawLines(canvas, left, top, panel);
}
void drawBody(PlotCanvas& canvas, double left, double top, const BarPanel& panel) {
  drawBars(canvas, left, top, panel);
}

/// Draws title, legend and body of each panel, from left to right and in rows.
template <typename Panel>
std::vector<std::byte> drawPanels(const std::vector<Panel>& panels) {
  CURVISPLAT_CHECK(!panels.empty());
  constexpr double kLegendTop = 36;
  PlotCanvas ruler(1, 1);
  ruler.font(kFont);
  double legend_height = 0, body_height = 0;
  for (const Panel& panel : panels) {
    const std::vector<std::string> names = namesOf(panel);
    if (!names.empty())
      legend_height = std::max(legend_height, drawLegend(nullptr, 0, 0, kPanelWidth - 36, names, ruler));
    body_height = std::max(body_height, heightOf(panel));
  }
  const double body_top = kLegendTop + legend_height + 4, height = body_top + body_height + 8;
  const size_t columns = std::min(panels.size(), kMaxInARow), rows = (panels.size() + columns - 1) / columns;
  PlotCanvas canvas(kPanelWidth * static_cast<double>(columns), height * static_cast<double>(rows));
  for (size_t n = 0; n < panels.size(); ++n) {
    const double left = kPanelWidth * static_cast<double>(n % columns);
    const double top = height * static_cast<double>(n / columns);
    drawTitle(canvas, left, top, panels[n].title);
    drawLegend(&canvas, left + 12, top + kLegendTop, kPanelWidth - 36, namesOf(panels[n]), canvas);
    drawBody(canvas, left, top + body_top, panels[n]);
  }
  return canvas.png();
}

}  // namespace

void requirePlots() {}

std::vector<std::byte> drawPlot(const std::vector<LinePanel>& panels) {
  return drawPanels(panels);
}
std::vector<std::byte> drawPlot(const std::vector<BarPanel>& panels) {
  return drawPanels(panels);
}

}  // namespace curvisplat
