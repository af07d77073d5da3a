// Colours in tests of colour maps and transfer functions.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <glm/vec3.hpp>

#include "render/colour/control_points.h"

namespace curvisplat {

inline void expectColour(const glm::dvec3& found, const glm::dvec3& expected, double tolerance) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], tolerance) << "channel " << c;
}

inline ColourMap redToBlue(ColourSpace space) {
  const ColourPoint points[] = {{0, {1, 0, 0}}, {1, {0, 0, 1}}};
  return ColourMap(points, space);
}

}  // namespace curvisplat
