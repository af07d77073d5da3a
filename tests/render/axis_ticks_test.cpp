#include "render/annotate/annotated_scene.h"

#include <gtest/gtest.h>

#include <cmath>

namespace curvisplat {
namespace {

std::vector<std::string> labels(double low, double high, int wanted, bool log_scale = false) {
  std::vector<std::string> texts;
  for (const AxisTick& tick : axisTicks({{low, high}, log_scale}, wanted)) texts.push_back(tick.label);
  return texts;
}
using Labels = std::vector<std::string>;

TEST(AxisTicks, StandAtRoundNumbers) {
  EXPECT_EQ(labels(0, 1, 6), (Labels{"0.0", "0.2", "0.4", "0.6", "0.8", "1.0"}));
  EXPECT_EQ(labels(0.193, 4.98, 6), (Labels{"1", "2", "3", "4"}));
  EXPECT_EQ(labels(-2.1, 29.4, 5), (Labels{"0", "10", "20"}));
  EXPECT_EQ(labels(101300, 101345, 4), (Labels{"101300", "101320", "101340"}));
  EXPECT_EQ(labels(0, 3e-7, 4), (Labels{"0e+00", "1e-07", "2e-07", "3e-07"}));
  EXPECT_EQ(labels(1e7, 1.0003e7, 4), (Labels{"1.0000e+07", "1.0001e+07", "1.0002e+07", "1.0003e+07"}));
}

TEST(AxisTicks, AreTwoAtLeast) {
  EXPECT_EQ(labels(0.1, 0.9, 3), (Labels{"0.2", "0.4", "0.6", "0.8"}));
  EXPECT_EQ(labels(-0.4, 0.4, 2), (Labels{"-0.4", "-0.2", "0.0", "0.2", "0.4"}));
  for (int n = 0; n < 500; ++n) {
    const double low = 0.137 * n - 20, high = low + std::pow(1.05, n % 97);
    EXPECT_GE(axisTicks({{low, high}}, 2 + n % 7).size(), 2u) << low << " to " << high;
  }
}

TEST(AxisTicks, KeepTheirEndsThoughRoundingMovesThem) {
  const auto ticks = axisTicks({{0.1, 0.3}}, 3);
  ASSERT_EQ(ticks.size(), 3u);
  EXPECT_EQ(ticks.front().label, "0.1");
  EXPECT_EQ(ticks.back().label, "0.3");
}

TEST(AxisTicks, OfALogarithmStandAtPowersOfTen) {
  EXPECT_EQ(labels(1, 10000, 5, true), (Labels{"1", "10", "100", "1000", "10000"}));
  EXPECT_EQ(labels(1, 100, 8, true), (Labels{"1", "2", "5", "10", "20", "50", "100"}));
  EXPECT_LE(labels(1e-12, 1e12, 6, true).size(), 8u);
}

TEST(AxisTicks, OfAnAsinhScaleHaveRoom) {
  const auto labels = [](std::pair<double, double> range, const AsinhScale& scale) {
    const ScalarAxis axis{range, false, scale};
    std::vector<std::string> texts;
    double last = -1;
    for (const AxisTick& tick : axisTicks(axis, 8)) {
      EXPECT_GT(axis.fractionOf(tick.value), last + 0.08) << tick.label;
      last = axis.fractionOf(tick.value);
      texts.push_back(tick.label);
    }
    return texts;
  };
  EXPECT_EQ(labels({-25000, 1500}, {0, 1}),
            (Labels{"-10000", "-1000", "-100", "-10", "0", "10", "100", "1000"}));
  EXPECT_EQ(labels({250, 400}, {300, 1}),
            (Labels{"250", "280", "292", "297", "299", "300", "301", "303", "310", "330", "400"}));
}

TEST(AxisTicks, OfARangeWithoutLengthIsOne) {
  EXPECT_EQ(labels(3, 3, 5), Labels{"3"});
}

TEST(AxisTicks, EndWhereNumbersHardlyDiffer) {
  for (const double low : {1.0, -1e30, 1e-30})
    for (const bool log_scale : {false, true}) {
      if (log_scale && low < 0) continue;
      const double high = std::nextafter(low, 1e300);
      EXPECT_EQ(axisTicks({{low, high}, log_scale}, 5).size(), 1u) << low;
    }
}

}  // namespace
}  // namespace curvisplat
