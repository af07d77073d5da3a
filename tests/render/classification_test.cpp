#include "render/colour/classification.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace curvisplat {
namespace {

using Value = TransferFunction::Value;

TEST(Classification, MeanOfAStepIsTheShareAboveIt) {
  const ClassificationTable table(
      [](double f) {
        return Value{glm::dvec3(0.25, 0.5, 1), f > 0.5 ? 16.0 : 0.0};
      },
      0, 1);
  for (const double width : {0.002, 0.05, 0.3, 0.7})
    for (double centre = -0.4; centre < 1.4; centre += 0.0137) {
      const double share = std::clamp((centre + width - 0.5) / (2 * width), 0.0, 1.0);
      const glm::dvec4 mean = table.mean(centre, width);
      // The step may lie anywhere within an eighth of a cell.
      EXPECT_NEAR(mean.w, 16 * share, 16 * (1.0 / 8 / ClassificationTable::kCells) / (2 * width) + 1e-9);
      EXPECT_NEAR(mean.x, 0.25 * mean.w, 1e-9);
      EXPECT_NEAR(mean.z, mean.w, 1e-9);
    }
}

TEST(Classification, MeanOfASmoothFunctionIsItsIntegral) {
  const auto integral = [](double f) { return 2 + 8 * f * f * f / 3; };  // of 8 f²
  const ClassificationTable table([](double f) { return Value{glm::dvec3(f), 8 * f * f}; }, 0, 1);
  for (const double width : {0.01, 0.2})
    for (double centre = width; centre < 1 - width; centre += 0.01) {
      EXPECT_NEAR(table.mean(centre, width).w,
                  (integral(centre + width) - integral(centre - width)) / (2 * width), 1e-5);
      EXPECT_NEAR(table.mean(centre, 0).w, 8 * centre * centre, 1e-5);
    }
}

TEST(Classification, GoesOnAsAtItsEnds) {
  const ClassificationTable table([](double f) { return Value{glm::dvec3(1), 1 + f}; }, 2, 4);
  EXPECT_NEAR(table.mean(-100, 3).w, 3, 1e-9);
  EXPECT_NEAR(table.mean(100, 3).w, 5, 1e-9);
  // Half of the interval is below the table, half of it where the extinction goes from 3 to 4.
  EXPECT_NEAR(table.mean(2, 1).w, 0.5 * 3 + 0.5 * 3.5, 1e-6);
}

TEST(Classification, LogScaleHasItsCellsInTheLogarithm) {
  const ClassificationTable table([](double f) { return Value{glm::dvec3(1), std::log10(f)}; }, 1, 1e6, true);
  for (double f : {3.0, 1e2, 1e5}) EXPECT_NEAR(table.mean(f, 0).w, std::log10(f), 1e-3);
  EXPECT_EQ(table.mean(-5, 0).w, 0);  // no logarithm: as the lowest
  EXPECT_TRUE(std::isfinite(table.mean(0, 10).w));
}

TEST(Classification, TransparentRangesHaveNoExtinction) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(-0.3f, 1.3f);
  const ClassificationTable table(
      [](double f) {
        return Value{glm::dvec3(1), (f > 0.3 && f < 0.32) || (f > 0.7 && f < 0.7004) ? 5.0 : 0.0};
      },
      0, 1);
  int transparent = 0;
  for (int n = 0; n < 20000; ++n) {
    float low = unit(random), high = unit(random);
    // Often within three cells of where the opaque ranges begin and end.
    constexpr float kEdges[] = {0.3f, 0.32f, 0.7f, 0.7004f};
    if (n % 2) (n % 4 == 1 ? low : high) = kEdges[n / 4 % 4] + 3 * unit(random) / ClassificationTable::kCells;
    if (low > high) std::swap(low, high);
    const double extinction = table.mean(0.5 * (double{low} + high), 0.5 * (double{high} - low)).w;
    if (table.fullyTransparent(low, high)) {
      ++transparent;
      EXPECT_EQ(extinction, 0) << low << ' ' << high;
    } else {
      EXPECT_GT(table.mean(0.5 * (double{low} + high), 0.5 * (double{high} - low) + 2e-3).w, 0)
          << low << ' ' << high;
    }
  }
  EXPECT_GT(transparent, 3000);
  EXPECT_TRUE(table.fullyTransparent(-INFINITY, 0.2f));
  EXPECT_FALSE(table.fullyTransparent(-INFINITY, INFINITY));
}

TEST(Classification, OpaqueEndsAreSeenBeyondThem) {
  const ClassificationTable table([](double f) { return Value{glm::dvec3(1), f == 1 ? 1.0 : 0.0}; }, 0, 1);
  EXPECT_TRUE(table.fullyTransparent(-5, 0.99f));
  EXPECT_FALSE(table.fullyTransparent(1.5f, 2));
  EXPECT_NEAR(table.mean(2, 0.1).w, 1, 1e-9);
}

TEST(Classification, OfAPresetFollowsItWhereDataCanBe) {
  const auto preset = TransferFunction::preset("viridis", 0, 1, 0.1);
  // Data in a hundredth of the preset's range: the table must be as fine as the data.
  const ClassificationTable narrow = ClassificationTable::of(preset, 0.50, 0.51);
  const ClassificationTable wide = ClassificationTable::of(preset, -3, 7);
  for (double f = 0.5; f <= 0.51; f += 0.0007) {
    EXPECT_NEAR(narrow.mean(f, 0).w, preset.at(f).extinction, 1e-4 * preset.at(f).extinction);
    EXPECT_NEAR(narrow.mean(f, 0).y, preset.at(f).colour.g * preset.at(f).extinction, 1e-3);
  }
  for (double f : {-2.0, 0.3, 0.9, 5.0}) EXPECT_NEAR(wide.mean(f, 0).w, preset.at(f).extinction, 1e-2);
  // No range at all, and none that the preset changes in.
  EXPECT_NEAR(ClassificationTable::of(preset, 0.3, 0.3).mean(0.3, 0).w, preset.at(0.3).extinction, 1e-3);
  EXPECT_NEAR(ClassificationTable::of(preset, 8, 9).mean(8.5, 0.1).w, preset.at(8.5).extinction, 1e-9);
}

TEST(Classification, OfDataTooNarrowForSinglePrecisionIsFinite) {
  const auto preset = TransferFunction::preset("viridis", -1, 1, 0.1);
  const ClassificationTable table = ClassificationTable::of(preset, 0, 8e-44);
  EXPECT_TRUE(std::isfinite(table.scale()) && std::isfinite(table.bias()));
  EXPECT_FALSE(table.fullyTransparent(0, 8e-44f));
  EXPECT_NEAR(table.mean(0, 0).z, preset.at(0).colour.b * preset.at(0).extinction, 1e-3);
}

TEST(Classification, ShowsNoValueThatTheDataDoesNotHave) {
  const auto preset = TransferFunction::preset("grey", 0, 60, 1);
  // A tangent reaches 45 beside a step from 0 to 35.
  const ClassificationTable table = ClassificationTable::of(preset, 0, 35);
  EXPECT_NEAR(table.mean(45, 0).w, preset.at(35).extinction, 1e-6);
  EXPECT_NEAR(table.mean(40, 4).y, preset.at(35).colour.g * preset.at(35).extinction, 1e-6);
  EXPECT_NEAR(table.mean(-9, 3).w, preset.at(0).extinction, 1e-6);
  EXPECT_NEAR(table.mean(17, 0).w, preset.at(17).extinction, 1e-3);
}

}  // namespace
}  // namespace curvisplat
