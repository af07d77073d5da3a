#include "preprocess/splats/joint_line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace curvisplat {
namespace {

constexpr double kSteps = 24;  // of a logarithm to the base of 2

/// What a length becomes that is kept.
double kept(double length, double unit) {
  const double steps = std::clamp(std::round(kSteps * std::log2(length / unit)), -127.0, 127.0);
  return unit * std::exp2(steps / kSteps);
}

void expectKept(const CellRow& row, float unit) {
  SquaredExtents extents;
  for (size_t n = 0; n < row.size(); ++n) extents[n] = 4 * row[n] * row[n];
  const JointLine of_row(row, unit), of_extents = JointLine::ofExtents(extents, unit);
  ASSERT_TRUE(of_row.isThere());
  ASSERT_TRUE(of_extents.isThere());
  for (size_t n = 0; n < row.size(); ++n) {
    ASSERT_NEAR(of_row.row()[n] / kept(row[n], unit), 1, 1e-12) << row[n] << " " << unit;
    ASSERT_NEAR(of_extents.row()[n] / kept(std::sqrt(extents[n]) / 2, unit), 1, 1e-12)
        << row[n] << " " << unit;
  }
}

TEST(JointLine, RoundsLogarithmsAsTheExactOnesAre) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> exponent(-6, 6);
  for (int n = 0; n < 20000; ++n) {
    const auto unit = static_cast<float>(std::exp2(exponent(random)));
    CellRow row;
    for (double& length : row) length = unit * std::exp2(exponent(random));
    expectKept(row, unit);
  }
}

TEST(JointLine, RoundsBesideTheMiddleBetweenTwoSteps) {
  for (int steps = -130; steps <= 130; ++steps)
    for (const double beside : {-1e-3, -1e-6, -1e-9, 1e-9, 1e-6, 1e-3}) {
      CellRow row;
      row.fill(3 * std::exp2((steps + 0.5 + beside) / kSteps));
      expectKept(row, 3);
    }
}

TEST(JointLine, KeepsLengthsOfAnySize) {
  for (const double length : {1e-300, 1e-160, 1e-40, 1e-12, 1.0, 1e12, 1e40, 1e150}) {
    CellRow row;
    row.fill(length);
    SquaredExtents extents;
    extents.fill(length);
    const double kept_length = JointLine(row, 1).row()[2],
                 kept_extent = JointLine::ofExtents(extents, 1).row()[2];
    EXPECT_NEAR(kept_length, kept(length, 1), 1e-12 * kept_length);
    EXPECT_NEAR(kept_extent, kept(std::sqrt(length) / 2, 1), 1e-12 * kept_extent);
  }
  EXPECT_FALSE(JointLine({1, 1, 0, 1, 1}, 1).isThere());
  EXPECT_FALSE(JointLine({1, 1, 1, 1, 1}, 0).isThere());
  EXPECT_FALSE(JointLine::ofExtents({1, 1, 1, NAN, 1}, 1).isThere());
  EXPECT_FALSE(JointLine::ofExtents({1, 1, 1, 1, INFINITY}, 1).isThere());
}

}  // namespace
}  // namespace curvisplat
