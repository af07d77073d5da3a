#include "render/project/kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace curvisplat {
namespace {

using std::numbers::pi;

/// ∫ of `f` over [0, kKernelSupport] by the midpoint rule.
template <typename F>
double integral(F f, int steps = 4000) {
  const double step = kKernelSupport / steps;
  double sum = 0;
  for (int n = 0; n < steps; ++n) sum += f((n + 0.5) * step) * step;
  return sum;
}

TEST(Kernel, IntegratesToOneAndHasItsDeviation) {
  EXPECT_NEAR(integral([](double r) { return 4 * pi * r * r * kernel(r); }), 1.0, 2e-5);
  const double variance = integral([](double r) { return 4 * pi * std::pow(r, 4) / 3 * kernel(r); });
  EXPECT_NEAR(std::sqrt(variance), kKernelSigma, 1e-5);
}

TEST(Kernel, IsContinuousWithItsSlopeAtTheKnotAndEndsSmoothly) {
  const double knot = 0.889392, step = 1e-5;
  EXPECT_NEAR(kernel(knot - 1e-9), kernel(knot + 1e-9), 1e-5);
  EXPECT_NEAR((kernel(knot - step) - kernel(knot - 2 * step)) / step,
              (kernel(knot + 2 * step) - kernel(knot + step)) / step, 1e-3);
  EXPECT_EQ(kernel(kKernelSupport), 0.0);
  EXPECT_LT(kernel(kKernelSupport - 1e-4), 1e-8);
}

TEST(Kernel, SumsToOneOverALattice) {
  for (double x : {0.0, 0.25, 0.5})
    for (double y : {0.0, 0.3, 0.5})
      for (double z : {0.0, 0.1, 0.5}) {
        double sum = 0;
        for (int i = -2; i <= 2; ++i)
          for (int j = -2; j <= 2; ++j)
            for (int k = -2; k <= 2; ++k) sum += kernel(std::hypot(x - i, y - j, z - k));
        EXPECT_NEAR(sum, 1.0, 0.0055) << x << ' ' << y << ' ' << z;
      }
}

TEST(Footprint, IntegratesToOne) {
  EXPECT_NEAR(integral([](double rho) { return 2 * pi * rho * footprint(rho); }), 1.0, 2e-5);
}

TEST(Footprint, IsTheIntegralAlongTheRay) {
  for (double rho : {0.0, 0.01, 0.4, 0.889, 0.9, 1.3, 1.55}) {
    double sum = 0;
    const double step = 2.5e-5;
    for (double t = 0.5 * step; t < kKernelSupport; t += step) sum += 2 * step * kernel(std::hypot(rho, t));
    EXPECT_NEAR(footprint(rho), sum, 1e-9) << rho;
  }
  EXPECT_EQ(footprint(kKernelSupport), 0.0);
}

TEST(Footprint, TableIsGoodToAHundredThousandth) {
  const int steps = 1024;
  const auto table = footprintTable(steps);
  ASSERT_EQ(table.size(), 1025u);
  for (double rho = 0; rho < kKernelSupport; rho += 0.00123) {
    const double at = rho * rho / (kKernelSupport * kKernelSupport) * steps;
    const auto cell = static_cast<size_t>(at);
    const double value = std::lerp(table[cell], table[cell + 1], at - std::floor(at));
    EXPECT_NEAR(value, footprint(rho), 1e-5) << rho;
  }
}

}  // namespace
}  // namespace curvisplat
