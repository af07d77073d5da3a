#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "render/colour/classification.h"
#include "render/frame/frame_plan.h"

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

/// The classes at the middles of a table's cells, below it and above it.
struct Classes {
  explicit Classes(const ClassificationTable& table)
      : log_scale(table.logScale()), scale(table.scale()), bias(table.bias()) {
    const auto sums = table.exactCumulative();
    for (int cell = 0; cell < ClassificationTable::kCells; ++cell)
      values.push_back(sums[cell + 1] - sums[cell]);
    values.insert(values.begin(), glm::dvec4(table.below()));
    values.push_back(glm::dvec4(table.above()));
  }

  double unlimitedCells(double scalar) const {
    return (log_scale ? std::log(std::max(scalar, 1e-37)) : scalar) * scale + bias;
  }
  /// Cells of the table, at most half a cell outside of it: nothing changes further out.
  double cells(double scalar) const {
    return std::clamp(unlimitedCells(scalar), -0.5, ClassificationTable::kCells + 0.5);
  }
  glm::dvec4 at(double cells) const {
    const double x = std::clamp(cells + 0.5, 0.0, static_cast<double>(values.size() - 1));
    const auto n = std::min(static_cast<size_t>(x), values.size() - 2);
    return glm::mix(values[n], values[n + 1], x - static_cast<double>(n));
  }
  static double change(const glm::dvec4& a, const glm::dvec4& b) {
    const glm::dvec4 d = glm::abs(a - b);
    return std::max({d.x, d.y, d.z, d.w});
  }
  /// The largest change between any two elements from `from` to `to`, in cells.
  double spread(double from, double to) const {
    const auto last = static_cast<double>(values.size() - 1);
    glm::dvec4 least(1e300), most(-1e300);
    for (auto n = static_cast<size_t>(std::clamp(std::floor(from + 0.5), 0.0, last));
         n <= static_cast<size_t>(std::clamp(std::ceil(to + 0.5), 0.0, last)); ++n) {
      least = glm::min(least, values[n]);
      most = glm::max(most, values[n]);
    }
    return change(least, most);
  }

  bool log_scale;
  double scale, bias;
  std::vector<glm::dvec4> values;
};

const std::vector<std::pair<const char*, std::function<Value(double)>>> kFunctions = {
    {"smooth",
     [](double f) {
       return Value{glm::dvec3(f, 1 - f, 0.5), 8 * f * f};
     }},
    {"step",
     [](double f) {
       return Value{glm::dvec3(1, 0.5, 0), f > 0.37 ? 16.0 : 0.0};
     }},
    {"peaks",
     [](double f) {
       return Value{glm::dvec3(f), std::abs(f - 0.6) < 0.001 || f > 0.99 ? 30.0 : 0.01};
     }},
    {"colours",
     [](double f) {
       return Value{glm::dvec3(f < 0.5, f, 0), 2.0};
     }},
};

TEST(ClassificationChange, BoundsWhatEveryPairOfValuesChanges) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const bool log_scale : {false, true}) {
    for (const auto& [name, at] : kFunctions) {
      const double from = log_scale ? 0.01 : 0, to = 1;
      const ClassificationTable table(at, from, to, log_scale);
      const ClassificationChange change(table);
      const Classes classes(table);
      for (int n = 0; n < 400; ++n) {
        const double low = -0.1 + 1.2 * unit(random), high = low + 0.3 * unit(random) * unit(random);
        const double deviation = std::pow(10.0, -6 + 6.2 * unit(random));
        const double bound = change.largestChange(static_cast<float>(low), static_cast<float>(high),
                                                  static_cast<float>(deviation));
        double largest = 0;
        for (int m = 0; m < 200; ++m) {
          const double value = low + (high - low) * unit(random),
                       other = value + deviation * (2 * unit(random) - 1);
          largest = std::max(
              largest, Classes::change(classes.at(classes.cells(value)), classes.at(classes.cells(other))));
        }
        EXPECT_GE(bound, largest - 1e-4) << name << ": " << low << " to " << high << " by " << deviation;
        const double lowest = log_scale ? std::max(low, from) : low;
        const double reach = log_scale
                                 ? classes.unlimitedCells(lowest) - classes.unlimitedCells(lowest - deviation)
                                 : classes.scale * deviation;
        EXPECT_LE(bound, std::min(reach, 1.0) * classes.spread(classes.cells(low) - 3 * reach - 5,
                                                               classes.cells(high) + 3 * reach + 5) +
                             1e-4)
            << name << ": " << low << " to " << high << " by " << deviation;
      }
    }
  }
}

TEST(ClassificationChange, AStepCountsWhereverItMayLie) {
  const ClassificationTable table(kFunctions[1].second, 0, 1);
  const ClassificationChange change(table);
  EXPECT_NEAR(change.largestChange(0.3f, 0.36f, 0.02f), 16, 1e-3);
  EXPECT_NEAR(change.largestChange(0.3f, 0.5f, 0.001f), 16, 1e-3);
  EXPECT_EQ(change.largestChange(0.1f, 0.3f, 0.01f), 0);
  EXPECT_EQ(change.largestChange(0.4f, 2, 0.005f), 0);
  EXPECT_EQ(change.largestChange(0.3f, 0.5f, 0), 0);
}

TEST(ClassificationChange, ASmoothFunctionChangesByItsSlope) {
  const ClassificationTable table([](double f) { return Value{glm::dvec3(0), 10 * f}; }, 0, 1);
  const ClassificationChange change(table);
  for (const float deviation : {1e-5f, 1e-3f, 0.01f, 0.1f}) {
    EXPECT_GE(change.largestChange(0.4f, 0.41f, deviation), 10 * deviation * 0.999);
    EXPECT_LE(change.largestChange(0.4f, 0.41f, deviation),
              10 * 6.5 * deviation + 0.02 * std::min(1.0f, 4096 * deviation));
  }
}

TEST(ClassificationChange, LargestExtinctionIsThatOfTheValues) {
  const ClassificationTable table(kFunctions[2].second, 0, 1);
  const ClassificationChange change(table);
  EXPECT_NEAR(change.largestExtinction(0.2f, 0.5f), 0.01, 1e-5);
  EXPECT_NEAR(change.largestExtinction(0.2f, 0.7f), 30, 1e-3);
  EXPECT_NEAR(change.largestExtinction(3, 4), 30, 1e-3);
}

TEST(ErrorWeight, IsAtMostFourPixelsWhereNothingShows) {
  EXPECT_EQ(leastErrorWeight(0), 1);
  EXPECT_EQ(leastErrorWeight(0.5), 0.25);
  EXPECT_EQ(leastErrorWeight(1), 0.25);
  EXPECT_EQ(leastErrorWeight(2), 0.5);
  EXPECT_EQ(leastErrorWeight(4), 1);
  EXPECT_EQ(leastErrorWeight(100), 1);
}

TEST(ErrorWeight, GrowsWithWhatShows) {
  EXPECT_EQ(errorWeight({}, 0.25), 0.25);
  EXPECT_EQ(errorWeight({.changed = 1}, 0.25), 1);
  EXPECT_EQ(errorWeight({.rippling = 50}, 0.25), 1);
  EXPECT_EQ(errorWeight({.share = 1.0 / 49}, 0.25), 0.25);
  EXPECT_EQ(errorWeight({.share = 1.0 / 47}, 0.25), 1);
  for (const double least : {0.25, 0.5}) {
    double changed = least, rippling = least;
    for (double depth = 1e-6; depth < 100; depth *= 1.7) {
      EXPECT_GE(errorWeight({.changed = depth}, least), changed);
      EXPECT_GE(errorWeight({.rippling = depth}, least), rippling);
      changed = errorWeight({.changed = depth}, least);
      rippling = errorWeight({.rippling = depth}, least);
      EXPECT_EQ(errorWeight({.changed = depth, .rippling = depth}, least), std::max(changed, rippling));
    }
    EXPECT_NEAR(changed, 1, 1e-12);
    EXPECT_NEAR(rippling, 1, 1e-12);
  }
}

/// No ray to the box is in step with the lattice for longer, and some is nearly as long.
TEST(ErrorWeight, LengthInStepIsThatOfTheRaysThroughTheBrick) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto anywhere = [&](double size) {
    return size * glm::dvec3(2 * unit(random) - 1, 2 * unit(random) - 1, 2 * unit(random) - 1);
  };
  for (int n = 0; n < 200; ++n) {
    CutView view;
    view.perspective = n % 2 == 0;
    view.scale = {1, 0.5 + unit(random), 2};
    view.eye = anywhere(10);
    view.towards_viewer = glm::normalize(anywhere(1));
    if (n % 10 == 1) view.towards_viewer = {0, 0.6, 0.8};
    Brick brick;
    brick.lower = anywhere(2);
    brick.upper = brick.lower + glm::dvec3(0.3, 0.2, 0.4);
    const double voxel = 0.02, whole = 7, length = lengthInStep(brick, view, voxel, whole);
    EXPECT_LE(length, whole);
    double longest = 0;
    for (int m = 0; m < 500; ++m) {
      const glm::dvec3 point = view.scale * glm::mix(brick.lower, brick.upper,
                                                     glm::dvec3(unit(random), unit(random), unit(random)));
      const glm::dvec3 d =
          glm::abs(view.perspective ? glm::normalize(point - view.eye) : view.towards_viewer);
      longest = std::max(longest, std::min(whole, voxel / (std::numbers::pi * std::min({d.x, d.y, d.z}))));
    }
    EXPECT_GE(length, longest * (1 - 1e-9));
    if (!view.perspective) {
      EXPECT_NEAR(length, longest, 1e-9);
    }
  }
}

}  // namespace
}  // namespace curvisplat
