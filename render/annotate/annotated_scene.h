// What annotations are drawn of: the view, the box around the data, the functions of the scalar bars; and
// the titles and ticks that name them. All of it is independent of Cairo, and pure; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <array>
#include <string>
#include <vector>

#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// What a scalar bar shows. The function is borrowed for the call.
struct ShownFunction {
  const TransferFunction* function;
  std::string title;       // "density [kg/m3]"
  bool opacities = false;  // its opacities, in grey, not its colours
};

/// The title of a scalar: "density [kg/m3]", or "density" if the unit is unknown.
std::string scalarTitle(const std::string& name, const std::string& unit);

/// What to annotate.
struct AnnotatedScene {
  ImageSize picture;  // the whole picture
  ScreenView view;    // has dataSize() (annotations.h)
  std::vector<ShownFunction> functions;
  glm::dvec3 lower{0.0}, upper{0.0};  // the box around the data, before --scale
  glm::vec4 background{1, 1, 1, 1};   // text and lines are black if it is light, else white
  std::array<std::string, 3> axis_titles{"x", "y", "z"};  // of the axes grid
};

/// A round number on a scale.
struct AxisTick {
  double value;
  std::string label;
};

/// Chooses about `wanted` (2 or more) ticks in [low, high], at multiples of 1, 2 or 5 times a power of ten.
/// On a logarithmic scale they are at powers of ten, with 2 and 5 times them if there are few. All labels
/// have the same number of decimals. If low == high there is one tick. Requires finite low <= high, and low
/// > 0 on a logarithmic scale.
std::vector<AxisTick> axisTicks(double low, double high, int wanted, bool log_scale);

}  // namespace curvisplat
