#include "render/project/footprint_skew.h"

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>

#include "render/project/kernel.h"
#include "stream/model/growth_code.h"

namespace curvisplat {

uint32_t FootprintSkew::pack() const {
  constexpr float kShift = 0x1.8p23f;  // rounds as std::nearbyint(), which is a call
  uint32_t skew = 0;
  for (size_t n = 0; n < 4; ++n) {
    const float steps = (std::clamp(t[n] * (1 / kSkewStep), -127.0f, 127.0f) + kShift) - kShift;
    skew |= static_cast<uint32_t>(static_cast<uint8_t>(static_cast<int>(steps))) << 8 * n;
  }
  return skew;
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
    const glm::vec3& e = axes.along[a];
    const float p0 = (rows.x0 * e.x + rows.y0 * e.y + rows.z0 * e.z) / ellipse.l11;
    const float p1 = (rows.x1 * e.x + rows.y1 * e.y + rows.z1 * e.z - ellipse.l21 * p0) / ellipse.l22;
    const float gamma = kSkewOfGrowth * axes.growth[a];
    skew.t[0] += gamma * p0 * p0 * p0;
    skew.t[1] += gamma * p0 * p0 * p1;
    skew.t[2] += gamma * p0 * p1 * p1;
    skew.t[3] += gamma * p1 * p1 * p1;
  }
  return skew.pack();
}

}  // namespace curvisplat
