// What annotations are drawn of: the view, the box around the data, the functions of the scalar bars.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
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

/// What to annotate.
struct AnnotatedScene {
  ImageSize picture;  // the whole picture
  ScreenView view;    // has dataSize() (annotations.h)
  std::vector<ShownFunction> functions;
  glm::dvec3 lower{0.0}, upper{0.0};  // the box around the data, before --scale
  glm::vec4 background{1, 1, 1, 1};   // text and lines are black if it is light, else white
  std::array<std::string, 3> axis_titles{"x", "y", "z"};  // of the axes grid
};

}  // namespace curvisplat
