// Chooses round numbers as ticks of a scale.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

struct AxisTick {
  double value;
  std::string label;
};

/// About `wanted` (2 or more) ticks in [low, high], at multiples of 1, 2 or 5 times a power of ten. On a
/// logarithmic scale they are at powers of ten, with 2 and 5 times them if there are few. All labels have the
/// same number of decimals. If low == high there is one tick. Requires finite low <= high, and low > 0 on a
/// logarithmic scale.
std::vector<AxisTick> axisTicks(double low, double high, int wanted, bool log_scale);

}  // namespace curvisplat
