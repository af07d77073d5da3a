// Interpolation of colours and opacities between points.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "render/colour/control_points.h"
#include "render/colour/transfer_function.h"
#include "tests/render/expected_colour.h"

namespace curvisplat {
namespace {

/// Colours as VTK prints them, in bytes.
void expectBytes(const glm::dvec3& found, int red, int green, int blue) {
  EXPECT_EQ(std::lround(255 * found.r), red);
  EXPECT_EQ(std::lround(255 * found.g), green);
  EXPECT_EQ(std::lround(255 * found.b), blue);
}

TEST(ColourMap, RgbIsLinear) {
  expectColour(redToBlue(ColourSpace::kRgb).at(0.25), {0.75, 0, 0.25}, 1e-12);
}

TEST(ColourMap, StepHasTheUpperEndsColour) {
  const ColourMap map = redToBlue(ColourSpace::kStep);
  expectBytes(map.at(0), 255, 0, 0);
  expectBytes(map.at(1e-9), 0, 0, 255);
  expectBytes(map.at(0.5), 0, 0, 255);  // as in VTK's own test
}

TEST(ColourMap, HsvTakesTheShorterWayRound) {
  // Red is hue 0, blue hue 2/3: the short way leads through magenta, the long one through green.
  expectBytes(redToBlue(ColourSpace::kHsv).at(0.5), 255, 0, 255);
  expectBytes(redToBlue(ColourSpace::kHsvNoWrap).at(0.5), 0, 255, 0);
}

TEST(ColourMap, HsvKeepsEndsOfEveryHue) {
  for (int hue = 0; hue < 64; ++hue) {
    const glm::dvec3 rgb((hue & 3) / 3.0, (hue >> 2 & 3) / 3.0, (hue >> 4 & 3) / 3.0);
    for (const auto space : {ColourSpace::kHsv, ColourSpace::kLab, ColourSpace::kDiverging}) {
      const ColourPoint points[] = {{0, {0.2, 0.5, 0.1}}, {1, rgb}, {2, {0.7, 0.1, 0.4}}};
      expectColour(ColourMap(points, space).at(1), rgb, 2e-3);
    }
  }
}

TEST(ColourMap, LabMeetsCie) {
  // Half way in L*a*b* between sRGB black and white is L* = 50: the grey of byte 119.
  const ColourPoint grey[] = {{0, glm::dvec3(0)}, {1, glm::dvec3(1)}};
  expectBytes(ColourMap(grey, ColourSpace::kLab).at(0.5), 119, 119, 119);
  // Red is (53.24, 80.09, 67.20), blue (32.30, 79.19, -107.86): half way in sRGB, computed from CIE's
  // formulas.
  expectBytes(redToBlue(ColourSpace::kLab).at(0.5), 202, 0, 136);
}

TEST(ColourMap, DivergingIsParaViewsCoolToWarm) {
  // Moreland's table of the map (9 of its 33 rows), which two points in Msh space with white between define.
  const ColourPoint points[] = {{0, glm::dvec3(59, 76, 192) / 255.0}, {1, glm::dvec3(180, 4, 38) / 255.0}};
  const int rows[9][3] = {{59, 76, 192},   {98, 130, 234},  {141, 176, 254}, {184, 208, 249}, {221, 221, 221},
                          {245, 196, 173}, {244, 154, 123}, {222, 96, 77},   {180, 4, 38}};
  const ColourMap map(points, ColourSpace::kDiverging);
  for (int n = 0; n < 9; ++n)
    expectColour(map.at(n / 8.0), glm::dvec3(rows[n][0], rows[n][1], rows[n][2]) / 255.0, 1.5 / 255);
}

TEST(ColourMap, DivergingOfLikeHuesStaysBetweenThem) {
  const ColourPoint points[] = {{0, {0.8, 0.1, 0.1}}, {1, {0.9, 0.3, 0.2}}};
  const glm::dvec3 middle = ColourMap(points, ColourSpace::kDiverging).at(0.5);
  EXPECT_LT(middle.g, 0.3) << "no white in between";
  EXPECT_GT(middle.r, 0.8);
}

TEST(ColourMap, EndsGoOnAndJumpsHoldTheirFirst) {
  const ColourPoint points[] = {
      {0, glm::dvec3(0.1)}, {1, glm::dvec3(0.3)}, {1, glm::dvec3(0.9)}, {2, glm::dvec3(0.5)}};
  const ColourMap map(points, ColourSpace::kRgb);
  EXPECT_DOUBLE_EQ(map.at(-5).r, 0.1);
  EXPECT_DOUBLE_EQ(map.at(7).r, 0.5);
  EXPECT_DOUBLE_EQ(map.at(1).r, 0.3);
  EXPECT_NEAR(map.at(1 + 1e-9).r, 0.9, 1e-8);
  EXPECT_DOUBLE_EQ(map.at(-INFINITY).r, 0.1);
  EXPECT_DOUBLE_EQ(map.at(INFINITY).r, 0.5);
}

double between(double x, double midpoint, double sharpness) {
  const OpacityPoint points[] = {{0, 0.2, midpoint, sharpness}, {1, 0.6, 0.5, 0}};
  return OpacityCurve(points).at(x);
}

TEST(OpacityCurve, SharpnessZeroIsTwoLinesThroughTheMidpoint) {
  EXPECT_DOUBLE_EQ(between(0.25, 0.5, 0), 0.3);
  EXPECT_DOUBLE_EQ(between(0.8, 0.8, 0), 0.4);
  EXPECT_DOUBLE_EQ(between(0.4, 0.8, 0), 0.3);
  EXPECT_DOUBLE_EQ(between(0.9, 0.8, 0.009), 0.5);
}

TEST(OpacityCurve, SharpnessOneIsAStepAtTheMidpoint) {
  EXPECT_DOUBLE_EQ(between(0.2999, 0.3, 1), 0.2);
  EXPECT_DOUBLE_EQ(between(0.3, 0.3, 1), 0.6);
  EXPECT_DOUBLE_EQ(between(0.3, 0, 1), 0.6);
}

TEST(OpacityCurve, BetweenItIsVtksHermiteCurve) {
  // By hand for sharpness 0.5, x = 0.25: s = 0.5 (0.5)^6 = 0.0078125; h2 + h3 t + h4 t with t = 0.5 is
  // 3s² - 2s³ + 0.5 (2s³ - 3s² + s) = 0.00399733
  EXPECT_NEAR(between(0.25, 0.5, 0.5), 0.2 + 0.4 * 0.00399733, 1e-8);
  EXPECT_NEAR(between(0.75, 0.5, 0.5), 0.6 - 0.4 * 0.00399733, 1e-8);
  // Sharpness 0.1: s = 0.5 (0.5)^2 = 0.125, t = 0.9: 0.04296875 + 0.9 * 0.08203125
  EXPECT_NEAR(between(0.25, 0.5, 0.1), 0.2 + 0.4 * 0.116796875, 1e-12);
  EXPECT_DOUBLE_EQ(between(0.7, 0.7, 0.4), 0.4);
}

TEST(OpacityCurve, EndsGoOnAndJumpsHoldTheirFirst) {
  const OpacityPoint points[] = {{0, 0.1}, {1, 0.3}, {1, 0.9}, {2, 0.5}};
  const OpacityCurve curve(points);
  EXPECT_DOUBLE_EQ(curve.at(-1), 0.1);
  EXPECT_DOUBLE_EQ(curve.at(0.5), 0.2);
  EXPECT_DOUBLE_EQ(curve.at(1), 0.3);
  EXPECT_NEAR(curve.at(1 + 1e-9), 0.9, 1e-8);
  EXPECT_DOUBLE_EQ(curve.at(3), 0.5);
}

TEST(OpacityCurve, NeverLeavesTheRangeOfItsEnds) {
  for (int s = 0; s <= 20; ++s)
    for (int m = 0; m <= 10; ++m)
      for (int x = 0; x <= 100; ++x) {
        const double opacity = between(x / 100.0, m / 10.0, s / 20.0);
        EXPECT_TRUE(opacity >= 0.2 && opacity <= 0.6) << opacity;
      }
}

}  // namespace
}  // namespace curvisplat
