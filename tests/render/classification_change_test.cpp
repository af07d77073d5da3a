#include "render/colour/classification_change.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <random>
#include <utility>
#include <vector>

namespace curvisplat {
namespace {

using Value = TransferFunction::Value;

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
  /// At most half a cell outside of the table: nothing changes further out.
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
  /// Between any two elements from `from` to `to`, in cells.
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

}  // namespace
}  // namespace curvisplat
