#include "preprocess/splats/stretch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
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
  Stretch at(size_t n, StretchFit fit = StretchFit::kSteep) const {
    return stretchOf(extentsOnLine({nodes()}, static_cast<ptrdiff_t>(n), 1, static_cast<int>(n),
                                   static_cast<int>(x.size() - 1 - n)),
                     fit);
  }
  float stretch(size_t n) const { return at(n).factor; }
};

struct Exact {
  double factor, growth, drift;
};

/// The definition, by logarithms.
Exact definedStretch(const std::array<double, 5>& extents, StretchFit fit = StretchFit::kSteep) {
  const auto l = [&](size_t n) { return std::log(extents[n] / extents[2]); };
  const double curve = l(1) + l(3), far_curve = l(0) + l(4), slope = l(3) - l(1);
  const double bend = l(4) - l(0) - 2 * slope;
  const double way = slope < 0 ? -1 : 1, smaller = slope < 0 ? l(3) : l(1),
               smallest = slope < 0 ? l(4) : l(0);
  const double steadiness = smaller < -1e-3 ? std::clamp(smallest / smaller - 1, 0.0, 1.0) : 0.0;
  const double q = fit == StretchFit::kSteep ? steadiness * std::max(slope * slope - 0.7, 0.0) : 0.0;
  const double along = way * q;
  return {
      std::exp(0.1531 * curve + 0.0828 * curve * curve - 0.0418 * bend * slope +
               q * (0.0948 - 0.1096 * curve * curve + 0.0727 * way * bend)),
      slope * (0.5 + 0.2892 * curve - 0.0667 * far_curve) + bend * (0.0676 + 0.1392 * curve) - 0.0654 * along,
      slope * (0.07 + 0.0457 * curve) + 0.0033 * bend + 0.0189 * along};
}

Stretch ofExtents(const std::array<double, 5>& e, StretchFit fit) {
  return stretchOf(e[0] * e[0], e[1] * e[1], e[2] * e[2], e[3] * e[3], e[4] * e[4], fit);
}

TEST(Stretch, IsAsItIsDefined) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> log_extent(-0.25, 0.25), growth(-0.55, 0.55);
  for (int n = 0; n < 100; ++n) {
    std::array<double, 5> extents;
    const double steady = n % 2 == 0 ? 0 : growth(random);
    for (size_t m = 0; m < 5; ++m)
      extents[m] =
          1e-5 * std::exp(log_extent(random) * (n % 2 == 0 ? 0.8 : 0.1) + steady * static_cast<double>(m));
    for (const StretchFit fit : {StretchFit::kGentle, StretchFit::kSteep}) {
      const Stretch found = ofExtents(extents, fit);
      const Exact exact = definedStretch(extents, fit);
      EXPECT_NEAR(found.factor, exact.factor, found.factor == 1 ? 3e-4 : 3e-6);
      EXPECT_NEAR(found.growth, exact.growth, 3e-6);
      EXPECT_NEAR(found.drift, exact.drift, 3e-6);
    }
  }
}

/// The kernel of Crawfis and Max (1993), in units of the cell.
double kernel(double r) {
  if (r < 0.889392) return 0.557526 + r * r * (-1.157743 + 0.671033 * r);
  const double left = std::max(0.0, 1.556228 - r);
  return left * left * (0.067599 + 0.282474 * left);
}

/// The ripple of a uniform medium on a line of these steps: rms of the density over its mean, away from the
/// ends. `plain`: kernels as long as their cells, symmetric, in the middles.
struct RippleOptions {
  bool plain = false;
  StretchFit fit = StretchFit::kSteep;
};
double rippleOf(const std::vector<double>& steps, const RippleOptions& options) {
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
      const Stretch stretch = options.plain ? Stretch{} : line.at(n, options.fit);
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
  const RippleOptions fitted, plain{true};
  EXPECT_LT(rippleOf(elements(three, 1), fitted), 0.0035);
  EXPECT_LT(rippleOf(elements(three, 1.42), fitted),
            0.006);  // 0.0093 with a stretch and growth by a smoothed ln h
  EXPECT_LT(rippleOf(elements(six, 1), fitted), 0.006);  // 0.0140 so
  EXPECT_LT(rippleOf(jump, fitted), 0.0015);             // 0.0019 so
  EXPECT_LT(rippleOf(steady, fitted), 0.004);            // 0.0034, the same
  EXPECT_GT(rippleOf(elements(six, 1), plain), 0.05);
  EXPECT_GT(rippleOf(steady, plain), 0.015);
}

TEST(Stretch, EvensOutCellsThatGrowSteeply) {
  const auto growing = [](double growth) {
    std::vector<double> steps;
    for (int n = 0; n < 30; ++n) steps.push_back(std::pow(growth, n));
    return steps;
  };
  const RippleOptions gentle{false, StretchFit::kGentle}, steep{false, StretchFit::kSteep};
  EXPECT_GT(rippleOf(growing(1.9), gentle), 0.024);
  EXPECT_LT(rippleOf(growing(1.9), steep), 0.015);
  EXPECT_GT(rippleOf(growing(1.75), gentle), 0.018);
  EXPECT_LT(rippleOf(growing(1.75), steep), 0.0135);
  // Chebyshev elements of eight steps, whose cells grow by 1.9 and 1.8 at their ends.
  std::vector<double> elements;
  while (elements.size() < 40)
    for (const double step : {0.0761, 0.2168, 0.3244, 0.3827, 0.3827, 0.3244, 0.2168, 0.0761})
      elements.push_back(step * 4);
  EXPECT_LT(rippleOf(elements, steep), 1.05 * rippleOf(elements, gentle));
}

TEST(Stretch, LeavesSteadyGrowthAlone) {
  const auto expect_alone = [](double growth, StretchFit fit) {
    std::vector<double> steps;
    for (int n = 0; n < 9; ++n) steps.push_back(std::pow(growth, n));
    const Line line = Line::ofSteps(steps);
    for (size_t n = 0; n < line.x.size(); ++n) EXPECT_EQ(line.at(n, fit).factor, 1) << growth << " " << n;
  };
  for (const double growth : {1.0, 0.9, 1.05, 1.5, 0.5, 3.0}) expect_alone(growth, StretchFit::kGentle);
  for (const double growth : {1.0, 0.9, 1.05, 1.5, 0.67}) expect_alone(growth, StretchFit::kSteep);
}

TEST(Stretch, KnowsSteadyGrowthUpToTheEnds) {
  for (const double growth : {1.0, 0.9, 1.05, 1.25, 1.5, 0.6, 1.8}) {
    std::vector<double> steps;
    for (int n = 0; n < 9; ++n) steps.push_back(std::pow(growth, n));
    const Line line = Line::ofSteps(steps);
    const double q = std::max(4 * std::log(growth) * std::log(growth) - 0.7, 0.0);
    for (size_t n = 0; n < line.x.size(); ++n) {
      EXPECT_NEAR(line.at(n, StretchFit::kGentle).growth, std::log(growth), 0.001) << growth << " " << n;
      EXPECT_NEAR(line.at(n).growth, std::log(growth) - std::copysign(0.0654 * q, std::log(growth)), 0.001)
          << growth << " " << n;
      EXPECT_NEAR(line.stretch(n), std::exp(0.0948 * q), 0.001) << growth << " " << n;
    }
  }
}

TEST(Stretch, OfSpectralElementsIsTheSameWhereALineEndsBetweenTwo) {
  // Elements of three steps each, symmetric: their border is a mirror.
  const std::vector<double> whole_steps{1, 1.6, 1, 1, 1.6, 1, 1, 1.6, 1, 1, 1.6, 1};
  const Line whole = Line::ofSteps(whole_steps), half = Line::ofSteps({1, 1.6, 1, 1, 1.6, 1});
  for (size_t n = 0; n < half.x.size(); ++n) EXPECT_EQ(half.stretch(n), whole.stretch(n + 6)) << n;
  // Extents are 1, 1.3, 1.3 again and again.
  EXPECT_NEAR(whole.stretch(6), definedStretch({1.3, 1.3, 1, 1.3, 1.3}).factor, 3e-6);
  EXPECT_NEAR(whole.stretch(7), definedStretch({1.3, 1, 1.3, 1.3, 1}).factor, 3e-6);
  EXPECT_GT(whole.stretch(6), 1.05);
}

/// Expects the stretches of a row to have the bits of those of its nodes one by one. The distances between
/// nodes grow by `factor` from one to the next, twelve times, and shrink again.
void expectOneRow(double factor) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  std::vector<double> x, y, z;
  double at_x = 0, step = 1;
  for (int n = 0; n < 200; ++n) {
    x.push_back(at_x + step * jitter(random));
    y.push_back(step * jitter(random));
    z.push_back(1e3 + step * jitter(random));
    at_x += step;
    step *= n / 12 % 2 == 0 ? factor : 1 / factor;
  }
  const NodePositions nodes{x.data(), y.data(), z.data()};
  for (const ptrdiff_t stride : {1, 7}) {
    const ptrdiff_t first = 3 * stride;
    const size_t count = x.size() - static_cast<size_t>(6 * stride);
    std::vector<float> row(count), growth(count), drift(count);
    stretchNodes({nodes, first, stride, count}, {row.data(), growth.data(), drift.data()});
    for (size_t n = 0; n < count; ++n) {
      const ptrdiff_t at = first + static_cast<ptrdiff_t>(n);
      const auto before = static_cast<int>(at / stride),
                 after = static_cast<int>((static_cast<ptrdiff_t>(x.size()) - 1 - at) / stride);
      const Stretch alone = stretchOf(extentsOnLine({nodes}, at, stride, before, after));
      EXPECT_EQ(row[n], alone.factor) << stride << " " << n;
      EXPECT_EQ(growth[n], alone.growth) << stride << " " << n;
      EXPECT_EQ(drift[n], alone.drift) << stride << " " << n;
    }
  }
}

TEST(Stretch, OfARowIsThatOfItsNodes) {
  for (const double factor : {1.0, 1.4, 1.8, 2.5}) expectOneRow(factor);
}

TEST(Stretch, OfARowIsThatOfItsNodesAcrossFaces) {
  constexpr ptrdiff_t kRow = 90, kPlane = kRow * 12;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  std::array<std::vector<double>, 3> x;
  for (ptrdiff_t n = 0; n < 12 * kPlane; ++n)
    for (size_t axis = 0; axis < 3; ++axis) {
      const ptrdiff_t index[] = {n % kRow, n / kRow % 12, n / kPlane};
      x[axis].push_back(static_cast<double>(index[axis]) + jitter(random));
    }
  const std::array<ptrdiff_t, 3> strides{1, kRow, kPlane};
  for (size_t axis = 0; axis < 3; ++axis) {
    const ptrdiff_t p = strides[(axis + 1) % 3], q = strides[(axis + 2) % 3];
    const NodePositions nodes{x[0].data(), x[1].data(), x[2].data()};
    constexpr ptrdiff_t kFirst = 5 + 5 * kRow + 5 * kPlane;
    constexpr size_t kCount = 80;
    std::vector<float> row(kCount), growth(kCount), drift(kCount);
    stretchNodes({nodes, kFirst, strides[axis], kCount, {p, q}}, {row.data(), growth.data(), drift.data()});
    for (size_t n = 0; n < kCount; ++n) {
      const ptrdiff_t at = kFirst + static_cast<ptrdiff_t>(n);
      const auto position = [&](ptrdiff_t node) {
        const auto element = static_cast<size_t>(node);
        return glm::dvec3(x[0][element], x[1][element], x[2][element]);
      };
      const auto difference = [&](ptrdiff_t step) { return position(at + step) - position(at - step); };
      const CellLengths cells{nodes, glm::cross(difference(p), difference(q))};
      const Stretch alone = stretchOf(extentsOnLine(cells, at, strides[axis], kStretchReach, kStretchReach));
      EXPECT_EQ(row[n], alone.factor) << axis << " " << n;
      EXPECT_EQ(growth[n], alone.growth) << axis << " " << n;
      EXPECT_EQ(drift[n], alone.drift) << axis << " " << n;
    }
  }
}

TEST(Stretch, OfShearedCellsDependsOnTheirWidths) {
  // Columns 1, 2, 4, ... wide over ground that rises and falls: x and z of nodes; y is across.
  std::vector<double> x, y, z;
  for (int j = -1; j < 2; ++j)
    for (int k = -1; k < 2; ++k)
      for (int i = 0; i < 9; ++i) {
        x.push_back(std::exp2(i));
        y.push_back(j);
        z.push_back(k + 5 * std::sin(2.0 * i));
      }
  constexpr ptrdiff_t kMiddle = 4 + 4 * 9;
  const NodePositions nodes{x.data(), y.data(), z.data()};
  const Stretch found =
      stretchOf(extentsOnLine({nodes, {2, 0, 0}}, kMiddle, 1, kStretchReach, kStretchReach));
  const Line flat(std::vector<double>(x.begin(), x.begin() + 9));
  EXPECT_NEAR(found.factor, flat.stretch(4), 1e-6);
  EXPECT_NEAR(found.growth, std::numbers::ln2, 0.1);
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
