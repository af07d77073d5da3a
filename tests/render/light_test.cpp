#include "render/project/light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <random>

#include "render/camera/camera.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{100, 80};

glm::dmat3 factorOf(const Shape& s) {
  return glm::dmat3(glm::dvec3(s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20),
                    glm::dvec3(0, s.axis1, s.axis1 * s.shear21), glm::dvec3(0, 0, s.axis2));
}

ScreenView viewOf(Projection projection, const glm::dvec3& scale = glm::dvec3(1)) {
  Camera camera;
  camera.position = {3, -4, 2};
  camera.focal_point = {0.5, 0, 0.25};
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  return ScreenView::of(camera, kSize, scale, kLowPass, 1e-3);
}

TEST(Light, IsPackedWithTheHalfWidth) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int n = 0; n < 1000; ++n) {
    const float width = std::exp(80 * (unit(random) - 0.5f));
    const Lit lit{unit(random), unit(random)};
    const float packed = packLit(width, lit);
    EXPECT_TRUE(std::isnormal(packed));
    EXPECT_NEAR(unpackHalfWidth(packed) / width, 1, 0.008);
    EXPECT_NEAR(unpackLit(packed).diffuse, lit.diffuse, 0.5 / 511 + 1e-6);
    EXPECT_NEAR(unpackLit(packed).specular, lit.specular, 0.5 / 127 + 1e-6);
  }
  for (const float width : {0.0f, 1e-42f, std::numeric_limits<float>::max()}) {
    const float packed = packLit(width, {});
    EXPECT_TRUE(std::isnormal(packed)) << width;
    EXPECT_EQ(unpackLit(packed).diffuse, 1);
    EXPECT_EQ(unpackLit(packed).specular, 0);
  }
  EXPECT_LT(unpackHalfWidth(packLit(0, {})), 1e-37f);
}

TEST(Light, IsThatOfTheGradientInTheWorld) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> around(-1, 1);
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective})
    for (int n = 0; n < 200; ++n) {
      const glm::dvec3 scale(1, n % 3 == 0 ? 1 : 2, n % 2 == 0 ? 1 : 0.25);
      const ScreenView view = viewOf(projection, scale);
      const glm::dvec3 origin(0.25, -0.5, 0.125), at(around(random), around(random), around(random));
      const Shape shape{
          static_cast<float>(1.5 + around(random)), static_cast<float>(0.1 * (1.5 + around(random))),
          static_cast<float>(1.5 + around(random)), static_cast<float>(around(random)),
          static_cast<float>(around(random)),       static_cast<float>(around(random))};
      const Slope slope{static_cast<float>(around(random)), static_cast<float>(around(random)),
                        static_cast<float>(around(random))};
      Light light;
      if (n % 4 != 0) light.towards = glm::dvec3(around(random), around(random), around(random));
      const double g0 = 0.5;
      const Lit found =
          LocalLight(light, g0, view, origin)
              .of(static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z), shape, slope);

      const glm::dvec3 w(slope.w0, slope.w1, slope.w2);
      const glm::dvec3 g = glm::inverse(glm::transpose(factorOf(shape))) * w / scale;
      const double strength = glm::dot(g, g) / (glm::dot(g, g) + g0 * g0);
      const glm::dvec3 viewer = projection == Projection::kPerspective
                                    ? glm::normalize(view.eye - scale * (origin + at))
                                    : -view.forward;
      const glm::dvec3 towards = light.towards ? glm::normalize(*light.towards) : viewer;
      const double facing = std::abs(glm::dot(glm::normalize(g), towards));
      const double shine = std::abs(glm::dot(glm::normalize(g), glm::normalize(towards + viewer)));
      EXPECT_NEAR(found.diffuse, 1 - strength + strength * (0.3 + 0.7 * facing), 1e-4);
      EXPECT_NEAR(found.specular, strength * 0.25 * std::pow(shine, 32), 1e-3);
    }
}

TEST(Light, LeavesWhatHasNoGradient) {
  const LocalLight light({}, 1, viewOf(Projection::kOrthographic), glm::dvec3(0));
  for (const Slope& slope : {Slope{0, 0, 0}, Slope{NAN, 0, 0}, Slope{1e30f, 0, 0}}) {
    const Lit lit = light.of(0, 0, 0, {1e-3f, 1, 1, 0, 0, 0}, slope);
    EXPECT_EQ(lit.diffuse, 1);
    EXPECT_EQ(lit.specular, 0);
  }
}

}  // namespace
}  // namespace curvisplat
