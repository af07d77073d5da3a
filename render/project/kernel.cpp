#include "render/project/kernel.h"

#include <algorithm>
#include <cmath>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr double kKnot = 0.889392;  // where the kernel's two pieces meet

/// ∫ K(√(rho² + t²)) dt over [from, to], inside one piece of K: Gauss-Legendre with 8 points.
double integral(double rho, double from, double to) {
  static constexpr double kAt[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                    0.9602898564975363};
  static constexpr double kWeight[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                        0.1012285362903763};
  const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
  double sum = 0;
  for (int point = 0; point < 4; ++point)
    for (const double t : {middle - half * kAt[point], middle + half * kAt[point]})
      sum += half * kWeight[point] * kernel(std::hypot(rho, t));
  return sum;
}

}  // namespace

double kernel(double r) {
  if (r < kKnot) return 0.557526 + r * r * (-1.157743 + 0.671033 * r);
  if (r < kKernelSupport) {
    const double rest = kKernelSupport - r;
    return rest * rest * (0.067599 + 0.282474 * rest);
  }
  return 0;
}

double footprint(double rho) {
  if (rho >= kKernelSupport) return 0;
  // r³ is not smooth in t if rho is small, so the pieces are divided into panels.
  constexpr int kPanels = 16;
  const double end = std::sqrt(kKernelSupport * kKernelSupport - rho * rho);
  const double knot = std::sqrt(std::max(0.0, kKnot * kKnot - rho * rho));
  double sum = 0;
  for (int panel = 0; panel < kPanels; ++panel) {
    const double from = static_cast<double>(panel) / kPanels, to = static_cast<double>(panel + 1) / kPanels;
    sum += integral(rho, knot * from, knot * to) +
           integral(rho, knot + (end - knot) * from, knot + (end - knot) * to);
  }
  return 2 * sum;
}

std::vector<double> footprintTable(int steps) {
  CURVISPLAT_CHECK_OP(steps, >=, 1);
  std::vector<double> table(static_cast<size_t>(steps) + 1, 0.0);
  for (int step = 0; step < steps; ++step)
    table[static_cast<size_t>(step)] =
        footprint(kKernelSupport * std::sqrt(static_cast<double>(step) / steps));
  return table;
}

}  // namespace curvisplat
