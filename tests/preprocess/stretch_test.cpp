#include "preprocess/splats/stretch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace curvisplat {
namespace {

/// Nodes on a straight line.
struct Line {
  std::vector<double> x, zero;

  explicit Line(std::vector<double> positions) : x(std::move(positions)), zero(x.size(), 0.0) {}
  static Line ofSteps(const std::vector<double>& steps) {
    std::vector<double> x{0};
    for (const double step : steps) x.push_back(x.back() + step);
    return Line(x);
  }

  NodePositions nodes() const { return {x.data(), zero.data(), zero.data()}; }
  Stretch at(size_t n) const {
    return stretchOnLine(nodes(), static_cast<ptrdiff_t>(n), 1, static_cast<int>(n),
                         static_cast<int>(x.size() - 1 - n));
  }
  float stretch(size_t n) const { return at(n).factor; }
};

/// The definition, by logarithms.
double blended(const std::array<double, 5>& extents) {
  constexpr double kWeights[] = {1, 4, 6, 4, 1};
  double mean = 0;
  for (size_t n = 0; n < 5; ++n) mean += kWeights[n] / 16 * std::log(extents[n]);
  return std::sqrt(0.418 + 0.582 * std::exp(2 * (mean - std::log(extents[2]))));
}

TEST(Stretch, IsTheBlendWithTheGeometricMean) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> log_extent(-0.2, 0.2);
  for (int n = 0; n < 100; ++n) {
    std::array<double, 5> extents;
    for (double& extent : extents) extent = 1e-5 * std::exp(log_extent(random));
    const auto squared = [&](size_t m) { return extents[m] * extents[m]; };
    const float found = stretchOf(squared(0), squared(1), squared(2), squared(3), squared(4));
    EXPECT_NEAR(found, blended(extents), found == 1 ? 3e-4 : 1e-6);
  }
}

TEST(Stretch, LeavesSteadyGrowthAloneWhateverItIs) {
  for (const double growth : {1.0, 0.9, 1.05, 1.5, 0.5, 3.0}) {
    std::vector<double> steps;
    for (int n = 0; n < 9; ++n) steps.push_back(std::pow(growth, n));
    const Line line = Line::ofSteps(steps);
    for (size_t n = 0; n < line.x.size(); ++n) EXPECT_EQ(line.stretch(n), 1) << growth << " " << n;
  }
}

TEST(Stretch, KnowsSteadyGrowthUpToTheEnds) {
  for (const double growth : {1.0, 0.9, 1.05, 1.25, 1.5, 0.6}) {
    std::vector<double> steps;
    for (int n = 0; n < 9; ++n) steps.push_back(std::pow(growth, n));
    const Line line = Line::ofSteps(steps);
    for (size_t n = 0; n < line.x.size(); ++n)
      EXPECT_NEAR(line.at(n).growth, std::log(growth), 0.001) << growth << " " << n;
  }
}

TEST(Stretch, GrowthIsTheSmoothedSlopeOfTheLogarithm) {
  const auto squared = [](double extent) { return extent * extent; };
  const double before2 = 0.7, before = 1.1, after = 1.3, after2 = 1.2;
  const double slope = (std::log(after2 / before2) + 2 * std::log(after / before)) / 8;
  EXPECT_NEAR(growthOf(squared(before2), squared(before), squared(after), squared(after2)), slope, 1e-4);
  EXPECT_EQ(growthOf(1, 2, 2, 1), 0);
  EXPECT_EQ(growthOf(0, 1, 1, 1), 0);
  EXPECT_EQ(growthOf(NAN, 1, 1, 1), 0);
  EXPECT_LT(growthOf(1, 1, 1e300, 1e300), 0.7);
}

TEST(Stretch, OfSpectralElementsIsTheSameWhereALineEndsBetweenTwo) {
  // Elements of three steps each, symmetric: their border is a mirror.
  const std::vector<double> whole_steps{1, 1.6, 1, 1, 1.6, 1, 1, 1.6, 1, 1, 1.6, 1};
  const Line whole = Line::ofSteps(whole_steps), half = Line::ofSteps({1, 1.6, 1, 1, 1.6, 1});
  for (size_t n = 0; n < half.x.size(); ++n) EXPECT_EQ(half.stretch(n), whole.stretch(n + 6)) << n;
  // Extents are 1, 1.3, 1.3 again and again.
  EXPECT_NEAR(whole.stretch(6), blended({1.3, 1.3, 1, 1.3, 1.3}), 1e-6);
  EXPECT_NEAR(whole.stretch(7), blended({1.3, 1, 1.3, 1.3, 1}), 1e-6);
  EXPECT_GT(whole.stretch(6), 1.05);
}

TEST(Stretch, OfARowIsThatOfItsNodes) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  std::vector<double> x, y, z;
  for (int n = 0; n < 200; ++n) {
    x.push_back(n + jitter(random));
    y.push_back(jitter(random));
    z.push_back(1e3 + jitter(random));
  }
  const NodePositions nodes{x.data(), y.data(), z.data()};
  for (const ptrdiff_t stride : {1, 7}) {
    const ptrdiff_t first = 3 * stride;
    const size_t count = x.size() - static_cast<size_t>(6 * stride);
    std::vector<float> row(count), growth(count);
    stretchNodes(nodes, first, stride, count, row.data(), growth.data());
    for (size_t n = 0; n < count; ++n) {
      const ptrdiff_t at = first + static_cast<ptrdiff_t>(n);
      const auto before = static_cast<int>(at / stride),
                 after = static_cast<int>((static_cast<ptrdiff_t>(x.size()) - 1 - at) / stride);
      const Stretch alone = stretchOnLine(nodes, at, stride, before, after);
      EXPECT_EQ(row[n], alone.factor) << stride << " " << n;
      EXPECT_EQ(growth[n], alone.growth) << stride << " " << n;
    }
  }
}

TEST(Stretch, IsBoundedAndOneWhereThereIsNothingToBlend) {
  for (size_t nodes = 1; nodes < 4; ++nodes) {
    const Line line = Line::ofSteps(std::vector<double>(nodes - 1, 2.0));
    for (size_t n = 0; n < nodes; ++n) EXPECT_EQ(line.stretch(n), 1) << nodes;
  }
  const Line point(std::vector<double>(9, 5.0));
  for (size_t n = 0; n < 9; ++n) EXPECT_EQ(point.stretch(n), 1);
  // A jump of a millionfold: cells beside it are stretched a little.
  const Line jump = Line::ofSteps({1, 1, 1, 1, 1, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6});
  float least = 1, most = 1;
  for (size_t n = 0; n < jump.x.size(); ++n) {
    least = std::min(least, jump.stretch(n));
    most = std::max(most, jump.stretch(n));
  }
  EXPECT_NEAR(least, 0.814, 0.01);
  EXPECT_NEAR(most, 1.342, 0.01);
  constexpr double kHuge = 1e300;
  EXPECT_TRUE(std::isfinite(stretchOf(kHuge, 0, 1e-300, kHuge, kHuge)));
  EXPECT_EQ(stretchOf(NAN, 1, 1, 1, 1), 1);
}

}  // namespace
}  // namespace curvisplat
