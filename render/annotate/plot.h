// Draws plots with Cairo: lines over sizes or counts, and bars. Linear value axes begin at zero, so that
// lengths can be compared.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace curvisplat {

/// A line of a plot.
struct PlotLine {
  std::string name;
  struct Point {
    double x, y;
  };
  std::vector<Point> points;  // by increasing x
};

/// Lines over a logarithmic x axis, with a tick at the x of every point; or profiles.
struct LinePanel {
  std::string title, x_name, y_name;
  std::vector<PlotLine> lines;
  std::function<std::string(double)> x_label;  // text of a tick
  bool log_values = false;                     // logarithmic y axis; requires positive values
  bool is_profile = false;                     // many points: linear axes around the values, and lines alone
};

/// A bar of a BarPanel.
struct Bar {
  std::string label;
  double value;
  std::string text;  // the value as text, drawn beside the bar
  size_t colour;     // bars of one kind share a colour
};

/// Horizontal bars, from top to bottom.
struct BarPanel {
  std::string title, x_name;
  std::vector<Bar> bars;
  std::vector<std::string> kinds;  // [colour], names for the legend; no legend for fewer than two
};

/// PNG files: bytes by file name.
using Plots = std::map<std::string, std::vector<std::byte>>;

/// Throws UsageError in a program that was built without plots; drawPlot() then gives no bytes.
void requirePlots();

/// Draws the panels side by side, at most three in a row. Returns the bytes of a PNG file. Throws Error.
std::vector<std::byte> drawPlot(const std::vector<LinePanel>& panels);
std::vector<std::byte> drawPlot(const std::vector<BarPanel>& panels);

}  // namespace curvisplat
