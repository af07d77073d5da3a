#include "render/project/footprint_skew.h"

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>

#include "render/project/kernel.h"
#include "stream/model/growth_frames.h"

namespace curvisplat {

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
