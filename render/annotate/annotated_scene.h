// The subject of annotations: the view, the box around the data, the functions of the scalar bars; and
// the titles and ticks that name them. All of it is independent of Cairo, and pure; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "render/colour/scalar_axis.h"
#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/project/screen_view.h"
#include "stream/model/globe.h"

namespace curvisplat {

/// The function that a scalar bar shows, and how. The function is borrowed for the call.
struct ShownFunction {
  enum class Part {
    kColours,    // alone: the picture's opacities are not this function's
    kOpacities,  // alone, in grey
    kBoth        // colours, and the curve of the opacities beside them
  };

  const TransferFunction* function;
  std::string title;  // "density [kg/m3]"
  Part part = Part::kColours;
};

/// The title of a scalar: "density [kg/m3]", or "density" if the unit is unknown.
std::string scalarTitle(const std::string& name, const std::string& unit);

/// A point of the data, before --scale, and the text beside it.
struct MarkerSign {
  glm::dvec3 point;
  std::string text;
};

/// The scene to annotate.
struct AnnotatedScene {
  ImageSize picture;  // the whole picture
  ScreenView view;    // has dataSize() (annotations.h)
  std::vector<ShownFunction> functions;
  glm::dvec3 lower{0.0}, upper{0.0};  // the box around the data, before --scale
  glm::vec4 background{1, 1, 1, 1};   // text and lines are black if it is light, else white
  std::array<std::string, 3> axis_titles{"x", "y", "z"};  // of the axes grid
  double text_size = 0;                                   // as in Annotations
  std::string title = {}, label = {};                     // above the data, and in its upper left corner

  /// A box of longitude, latitude (degrees) and height (kilometres).
  struct OnGlobe {
    Globe globe;
    glm::dvec3 lower, upper;

    /// Whether most of its heights are below zero: the axis has depths.
    bool isOfDepths() const { return lower.z + upper.z < 0; }
  };
  std::optional<OnGlobe> on_globe = std::nullopt;  // the axes grid is this box
  std::vector<MarkerSign> markers = {};
};

/// A round number on a scale.
struct AxisTick {
  double value;
  std::string label;
};

/// Chooses about `wanted` (2 or more) ticks, on a linear scale at least two, in the axis' range, at multiples of 1, 2 or 5 times a power
/// of ten. On a logarithmic scale they are at powers of ten, with 2 and 5 times them if there are few; on that of asinh at
/// the roundest numbers that have room. All labels of a linear scale have the same number of decimals. If both ends
/// are equal there is one tick. Requires finite ends that do not decrease, and above zero on a logarithmic scale.
std::vector<AxisTick> axisTicks(const ScalarAxis& axis, int wanted);

}  // namespace curvisplat
