#include "stream/model/growth_code.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <random>

namespace curvisplat {
namespace {

using Axes = std::array<glm::dvec3, 3>;
using Growth = std::array<double, 3>;

/// At right angles, of either handedness.
Axes randomAxes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const glm::dmat3 turn = glm::mat3_cast(
      glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random))));
  return {turn[0], turn[1], random() & 1 ? -turn[2] : turn[2]};
}

/// The third moment in a direction: what axes and growths stand for, whatever their order and signs.
double momentAlong(const Axes& axis, const Growth& growth, const glm::dvec3& direction) {
  double sum = 0;
  for (size_t n = 0; n < 3; ++n) sum += growth[n] * std::pow(glm::dot(axis[n], direction), 3);
  return sum;
}

double momentAlong(const CellGrowth& cell, const glm::dvec3& direction) {
  double sum = 0;
  for (size_t n = 0; n < 3; ++n)
    sum += cell.growth[n] * std::pow(glm::dot(glm::dvec3(cell.axis[n]), direction), 3);
  return sum;
}

TEST(GrowthCode, KeepsTheThirdMoment) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> around(-0.6, 0.6);
  for (int n = 0; n < 3000; ++n) {
    const Axes axis = randomAxes(random);
    Growth growth{};
    for (int a = 0; a < 1 + n % 3; ++a) growth[(a + n) % 3] = around(random);
    const uint32_t code = packGrowthCode(axis, growth);
    ASSERT_TRUE(isPossibleGrowthCode(code));
    const CellGrowth kept = cellGrowth(code);
    for (int m = 0; m < 10; ++m) {
      const glm::dvec3 direction = randomAxes(random)[0];
      // Half a step of the growth, and 5 degrees.
      ASSERT_NEAR(momentAlong(kept, direction), momentAlong(axis, growth, direction), 0.14) << code;
    }
    for (size_t a = 0; a < 3; ++a)
      for (size_t b = 0; b < 3; ++b) ASSERT_NEAR(glm::dot(kept.axis[a], kept.axis[b]), a == b, 1e-5);
  }
}

TEST(GrowthCode, AlongTheFramesOwnAxesIsWithoutRotation) {
  const Axes frame{glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  const uint32_t along_z = packGrowthCode(frame, {0, 0, 0.25});
  EXPECT_EQ(along_z, 4u << 10);
  // The same moment, seen from other axes.
  EXPECT_EQ(packGrowthCode({-frame[2], frame[0], frame[1]}, {-0.25, 0, 0}), along_z);
  const uint32_t all = packGrowthCode(frame, {0.25, -0.125, 0.0625});
  EXPECT_EQ(packGrowthCode({frame[1], -frame[0], -frame[2]}, {-0.125, -0.25, -0.0625}), all);
  const CellGrowth kept = cellGrowth(all);
  EXPECT_EQ(kept.growth[0], 0.25f);
  EXPECT_EQ(kept.growth[1], -0.125f);
  EXPECT_EQ(kept.growth[2], 0.0625f);
}

TEST(GrowthCode, OfLittleGrowthIsNone) {
  const Axes frame{glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  EXPECT_EQ(packGrowthCode(frame, {0.03, -0.03, 0}), kNoGrowth);
  EXPECT_NE(packGrowthCode(frame, {0.04, 0, 0}), kNoGrowth);
  EXPECT_EQ(cellGrowth(packGrowthCode(frame, {9, 0, 0})).growth[0], 0.625f);
  for (const float growth : cellGrowth(kNoGrowth).growth) EXPECT_EQ(growth, 0);
}

TEST(GrowthCode, IsRefusedWhereNothingPacksToIt) {
  EXPECT_TRUE(isPossibleGrowthCode(kNoGrowth));
  EXPECT_TRUE(isPossibleGrowthCode(10));
  EXPECT_FALSE(isPossibleGrowthCode(11));            // a growth beyond the largest
  EXPECT_FALSE(isPossibleGrowthCode(1u << 15));      // a rotation without growth
  EXPECT_FALSE(isPossibleGrowthCode(1 | 8u << 15));  // -8
  EXPECT_FALSE(isPossibleGrowthCode(1 | 1u << 27));
}

}  // namespace
}  // namespace curvisplat
