#include "render/project/footprint.h"

#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>

#include "stream/base/error.h"
#include "stream/model/growth_code.h"

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

FootprintSkew FootprintSkew::unpack(uint32_t skew) {
  FootprintSkew result;
  for (size_t n = 0; n < 4; ++n)
    result.t[n] = kSkewStep * static_cast<float>(static_cast<int8_t>(skew >> 8 * n & 0xff));
  return result;
}

double FootprintSkew::at(double u0, double u1) const {
  const double v0 = u0 / kKernelSigma, v1 = u1 / kKernelSigma;
  const double cubic =
      t[0] * v0 * v0 * v0 + 3 * v0 * v1 * (double{t[1]} * v0 + double{t[2]} * v1) + t[3] * v1 * v1 * v1;
  const double linear = (double{t[0]} + t[2]) * v0 + (double{t[1]} + t[3]) * v1;
  return std::max(0.0, 1 + (cubic - 3 * linear) / 6);
}

GrowthAxes growthAxes(const Shape& shape, uint32_t growth_code) {
  GrowthAxes axes;
  if (growth_code == kNoGrowth) return axes;
  const CellGrowth cell = cellGrowth(growth_code);
  for (size_t a = 0; a < 3; ++a) {
    if (cell.growth[a] == 0) continue;
    axes.along[axes.count] = inSpace(shape, cell.axis[a]);
    axes.unit[axes.count] = cell.axis[a];
    axes.growth[axes.count++] = cell.growth[a];
  }
  return axes;
}

uint32_t skewOf(const ScreenRows& rows, const GrowthAxes& axes, const Ellipse& ellipse) {
  FootprintSkew skew;
  for (size_t a = 0; a < axes.count; ++a) {
    const std::array<float, 4> added =
        skewOfAxis(rows, axes.along[a], axes.growth[a], {ellipse.l11, ellipse.l21, ellipse.l22});
    for (size_t t = 0; t < 4; ++t) skew.t[t] += added[t];
  }
  return skew.pack();
}

bool GrowthBlock::fill(std::span<const uint32_t> growth_codes) {
  const std::span<const GrowthFrame> frames = growthFrames();
  uint32_t any = kNoGrowth;
  for (const uint32_t code : growth_codes) any |= code;
  if (any == kNoGrowth) return false;
  for (size_t n = 0; n < growth_codes.size(); ++n) {
    const uint32_t code = growth_codes[n];
    const GrowthFrame& frame = frames[frameNumber(code)];
    for (size_t a = 0; a < axes_.size(); ++a) {
      axes_[a].x[n] = frame[a].x;
      axes_[a].y[n] = frame[a].y;
      axes_[a].z[n] = frame[a].z;
      axes_[a].growth[n] = growthOf(code, a);
    }
  }
  return true;
}

}  // namespace curvisplat
