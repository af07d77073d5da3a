#include "preprocess/splats/stretch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "stream/model/growth_code.h"
#include "stream/model/kernel.h"

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
    return stretchOf(extentsOnLine(nodes(), static_cast<ptrdiff_t>(n), 1, static_cast<int>(n),
                                   static_cast<int>(x.size() - 1 - n)));
  }
  float stretch(size_t n) const { return at(n).factor; }
};

struct Exact {
  double factor, growth, drift;
};

/// The definition, by logarithms.
Exact defined(const std::array<double, 5>& extents) {
  const auto l = [&](size_t n) { return std::log(extents[n] / extents[2]); };
  const double curve = l(1) + l(3), far_curve = l(0) + l(4), slope = l(3) - l(1);
  const double bend = l(4) - l(0) - 2 * slope;
  return {std::exp(0.1531 * curve + 0.0828 * curve * curve - 0.0418 * bend * slope),
          slope * (0.5 + 0.2892 * curve - 0.0667 * far_curve) + bend * (0.0676 + 0.1392 * curve),
          slope * (0.07 + 0.0457 * curve) + 0.0033 * bend};
}

Stretch ofExtents(const std::array<double, 5>& e) {
  return stretchOf(e[0] * e[0], e[1] * e[1], e[2] * e[2], e[3] * e[3], e[4] * e[4]);
}

TEST(Stretch, IsAsItIsDefined) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> log_extent(-0.2, 0.2);
  for (int n = 0; n < 100; ++n) {
    std::array<double, 5> extents;
    for (double& extent : extents) extent = 1e-5 * std::exp(log_extent(random));
    const Stretch found = ofExtents(extents);
    const Exact exact = defined(extents);
    EXPECT_NEAR(found.factor, exact.factor, found.factor == 1 ? 3e-4 : 3e-6);
    EXPECT_NEAR(found.growth, exact.growth, 3e-6);
    EXPECT_NEAR(found.drift, exact.drift, 3e-6);
  }
}

/// Of Crawfis and Max (1993), in units of the cell.
double kernel(double r) {
  if (r < 0.889392) return 0.557526 + r * r * (-1.157743 + 0.671033 * r);
  const double left = std::max(0.0, 1.556228 - r);
  return left * left * (0.067599 + 0.282474 * left);
}

/// Of a uniform medium on a line of these steps: rms of the density over its mean, away from the ends. `plain`: kernels as long as
/// their cells, symmetric, in the middles.
double rippleOf(const std::vector<double>& steps, bool plain) {
  const Line line = Line::ofSteps(steps);
  const auto marginal = [](double x) {  // of the kernel along two axes
    constexpr int kSamples = 60;
    double sum = 0;
    for (int n = 0; n < kSamples; ++n) {
      const double across = kKernelSupport * (n + 0.5) / kSamples;
      sum += kernel(std::sqrt(x * x + across * across)) * across;
    }
    return 2 * std::numbers::pi * sum * kKernelSupport / kSamples;
  };
  double sum = 0, squares = 0;
  constexpr int kPlaces = 400;
  const size_t last = line.x.size() - 1;
  for (int place = 0; place < kPlaces; ++place) {
    const double at = 6 + (static_cast<double>(last) - 12) * place / kPlaces;
    const auto node = static_cast<size_t>(at);
    const double x = std::lerp(line.x[node], line.x[node + 1], at - static_cast<double>(node));
    double density = 0;
    for (size_t n = 1; n < last; ++n) {
      const Stretch stretch = plain ? Stretch{} : line.at(n);
      const double cell = 0.5 * (line.x[n + 1] - line.x[n - 1]);
      const double middle = 0.25 * (line.x[n - 1] + 2 * line.x[n] + line.x[n + 1]) + stretch.drift * cell;
      const double u = (x - middle) / (stretch.factor * cell), v = u / kKernelSigma;
      if (std::abs(u) >= kKernelSupport) continue;
      const double skew = 1 + kSkewOfGrowth * stretch.growth * (v * v * v - 3 * v) / 6;
      density += marginal(u) / stretch.factor * std::max(0.0, skew);
    }
    sum += density;
    squares += density * density;
  }
  const double mean = sum / kPlaces;
  return std::sqrt(squares / kPlaces - mean * mean) / mean;
}

TEST(Stretch, EvensOutAUniformMedium) {
  const auto elements = [](std::vector<double> steps, double growth) {
    std::vector<double> all;
    for (double size = 1; all.size() < 40; size *= growth)
      for (const double step : steps) all.push_back(size * step);
    return all;
  };
  std::vector<double> jump(40, 1.0), steady;
  std::fill(jump.begin() + 20, jump.end(), 1.5);
  for (int n = 0; n < 40; ++n) steady.push_back(std::pow(1.25, n));
  const std::vector<double> three{1, 1.618, 1}, six{0.0849, 0.1808, 0.2343, 0.2343, 0.1808, 0.0849};
  EXPECT_LT(rippleOf(elements(three, 1), false), 0.0035);
  EXPECT_LT(rippleOf(elements(three, 1.42), false),
            0.006);                                     // 0.0093 with a stretch and growth by a smoothed ln h
  EXPECT_LT(rippleOf(elements(six, 1), false), 0.006);  // 0.0140 so
  EXPECT_LT(rippleOf(jump, false), 0.0015);             // 0.0019 so
  EXPECT_LT(rippleOf(steady, false), 0.004);            // 0.0034, the same
  EXPECT_GT(rippleOf(elements(six, 1), true), 0.05);
  EXPECT_GT(rippleOf(steady, true), 0.015);
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

TEST(Stretch, OfSpectralElementsIsTheSameWhereALineEndsBetweenTwo) {
  // Elements of three steps each, symmetric: their border is a mirror.
  const std::vector<double> whole_steps{1, 1.6, 1, 1, 1.6, 1, 1, 1.6, 1, 1, 1.6, 1};
  const Line whole = Line::ofSteps(whole_steps), half = Line::ofSteps({1, 1.6, 1, 1, 1.6, 1});
  for (size_t n = 0; n < half.x.size(); ++n) EXPECT_EQ(half.stretch(n), whole.stretch(n + 6)) << n;
  // Extents are 1, 1.3, 1.3 again and again.
  EXPECT_NEAR(whole.stretch(6), defined({1.3, 1.3, 1, 1.3, 1.3}).factor, 3e-6);
  EXPECT_NEAR(whole.stretch(7), defined({1.3, 1, 1.3, 1.3, 1}).factor, 3e-6);
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
    std::vector<float> row(count), growth(count), drift(count);
    stretchNodes(nodes, first, stride, count, {row.data(), growth.data(), drift.data()});
    for (size_t n = 0; n < count; ++n) {
      const ptrdiff_t at = first + static_cast<ptrdiff_t>(n);
      const auto before = static_cast<int>(at / stride),
                 after = static_cast<int>((static_cast<ptrdiff_t>(x.size()) - 1 - at) / stride);
      const Stretch alone = stretchOf(extentsOnLine(nodes, at, stride, before, after));
      EXPECT_EQ(row[n], alone.factor) << stride << " " << n;
      EXPECT_EQ(growth[n], alone.growth) << stride << " " << n;
      EXPECT_EQ(drift[n], alone.drift) << stride << " " << n;
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
  EXPECT_GE(least, 0.74);
  EXPECT_GT(most, 1.3);
  EXPECT_LE(most, 1.57);
  constexpr double kHuge = 1e300;
  for (const Stretch& odd : {stretchOf(kHuge, 0, 1e-300, kHuge, kHuge), stretchOf(0, 1, 1, 1, 1),
                             stretchOf(NAN, 1, 1, 1, 1), stretchOf(1, 1, 0, 1, 1)}) {
    EXPECT_EQ(odd.factor, 1);
    EXPECT_EQ(odd.growth, 0);
    EXPECT_EQ(odd.drift, 0);
  }
  EXPECT_LE(stretchOf(1, 1, 1, 1e200, 1e200).growth, 0.65f);
}

}  // namespace
}  // namespace curvisplat
