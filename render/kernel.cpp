#include "render/kernel.h"

#include <algorithm>
#include <cmath>

#include "stream/error.h"

namespace curvisplat {
namespace {

constexpr double kKnot = 0.889392;  // where the kernel's two pieces meet

/// ∫ K(√(rho² + t²)) tⁿ dt over [from, to] for n = 0 and 2, inside one piece of K: Gauss-Legendre with 8
/// points.
void addMoments(double rho, double from, double to, double& zeroth, double& second) {
  static constexpr double kAt[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                    0.9602898564975363};
  static constexpr double kWeight[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                        0.1012285362903763};
  const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
  for (int point = 0; point < 4; ++point) {
    for (const double side : {-1.0, 1.0}) {
      const double t = middle + side * half * kAt[point];
      const double value = half * kWeight[point] * kernel(std::sqrt(rho * rho + t * t));
      zeroth += value;
      second += value * t * t;
    }
  }
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

Footprint footprint(double rho) {
  if (rho >= kKernelSupport) return {};
  // r³ is not smooth in t where rho is small, so the pieces are cut up.
  constexpr int kPanels = 16;
  const double end = std::sqrt(kKernelSupport * kKernelSupport - rho * rho);
  const double knot = std::sqrt(std::max(0.0, kKnot * kKnot - rho * rho));
  double zeroth = 0, second = 0;
  for (int panel = 0; panel < kPanels; ++panel) {
    const double from = static_cast<double>(panel) / kPanels, to = static_cast<double>(panel + 1) / kPanels;
    addMoments(rho, knot * from, knot * to, zeroth, second);
    addMoments(rho, knot + (end - knot) * from, knot + (end - knot) * to, zeroth, second);
  }
  return {2 * zeroth, zeroth > 0 ? std::sqrt(second / zeroth) / kKernelSigma : 0.0};
}

std::vector<Footprint> footprintTable(int steps) {
  CURVISPLAT_CHECK_OP(steps, >=, 1);
  std::vector<Footprint> table(static_cast<size_t>(steps) + 1);
  for (int step = 0; step < steps; ++step)
    table[static_cast<size_t>(step)] =
        footprint(kKernelSupport * std::sqrt(static_cast<double>(step) / steps));
  return table;
}

}  // namespace curvisplat
