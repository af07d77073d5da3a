// Draws plots of lines as `curvisplat bench --plot` draws its own, for the scripts of bench/: reads JSON from standard
// input, writes a PNG file.
//
//   [{"title": "A frame", "x_name": "nodes", "y_name": "seconds", "log_values": true,
//     "lines": {"1 px": [[1e6, 0.2], [8e6, 0.9]]}}, ...]
//
//   curvisplat_line_plot OUT.png < plots.json
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <iostream>
#include <iterator>

#include "render/annotate/plot.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"

namespace {

using namespace curvisplat;

/// "8 M"
std::string labelOf(double x) {
  for (const auto& [unit, letter] : {std::pair(1e9, "G"), std::pair(1e6, "M"), std::pair(1e3, "k")})
    if (x >= unit) return fmt::format("{:.3g} {}", x / unit, letter);
  return fmt::format("{:.3g}", x);
}

LinePanel panelOf(const JsonField& plot) {
  LinePanel panel{
      plot.at("title").text(),     plot.at("x_name").text(), plot.at("y_name").text(), {}, labelOf,
      plot.at("log_values").flag()};
  const JsonField lines = plot.at("lines");
  for (const std::string& name : lines.names()) {
    PlotLine line{name, {}};
    for (const JsonField& point : lines.at(name).elements()) {
      const double x = point[0].number(), y = point[1].number();
      if (!(x > 0)) point[0].fail("a number above 0");
      if (!(y > 0) && panel.log_values) point[1].fail("a number above 0");
      line.points.push_back({x, y});
    }
    if (!line.points.empty()) panel.lines.push_back(std::move(line));
  }
  if (panel.lines.empty()) lines.fail("a line with a point");
  return panel;
}

}  // namespace

int main(int count, char** words) {
  if (count != 2) {
    std::fputs("usage: curvisplat_line_plot OUT.png < PLOTS.json\n", stderr);
    return 2;
  }
  try {
    const std::string text(std::istreambuf_iterator<char>(std::cin), {});
    const JsonDocument document(text, "standard input", "a list of plots");
    std::vector<LinePanel> panels;
    for (const JsonField& plot : document.root().elements()) panels.push_back(panelOf(plot));
    if (panels.empty()) document.root().fail("one plot or more");
    writeFileAtomically(words[1], drawPlot(panels));
  } catch (const std::exception& error) {
    fmt::print(stderr, "curvisplat_line_plot: {}\n", error.what());
    return 1;
  }
  return 0;
}
