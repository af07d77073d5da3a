// Plots for a report: lines over sizes or counts, and bars, drawn with Cairo. Axes of values begin at zero,
// so that lengths compare.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace curvisplat {

struct PlotLine {
  std::string name;
  struct Point {
    double x, y;
  };
  std::vector<Point> points;  // x increasing
};

/// Lines over x at equal ratios (a logarithmic axis), with a tick at every x that a line has.
struct LinePanel {
  std::string title, x_name, y_name;
  std::vector<PlotLine> lines;
  std::function<std::string(double)> x_label;  // of a tick
  bool log_values = false;                     // y at equal ratios too; all above zero
};

struct Bar {
  std::string label;
  double value;
  std::string text;  // behind the bar: the value for people
  size_t colour;     // bars of one kind have one colour
};

/// Horizontal bars, from the top down.
struct BarPanel {
  std::string title, x_name;
  std::vector<Bar> bars;
  std::vector<std::string> kinds;  // [colour]: for the key; one is not told
};

/// Files' names, and their PNGs.
using Plots = std::map<std::string, std::vector<std::byte>>;

/// Throws UsageError in a program that was built without plots; drawPlot() then gives no bytes.
void requirePlots();

/// A picture of panels side by side, as the bytes of a PNG file. Throws Error.
std::vector<std::byte> drawPlot(const std::vector<LinePanel>& panels);
std::vector<std::byte> drawPlot(const std::vector<BarPanel>& panels);

}  // namespace curvisplat
