// Round numbers along a scale, for people to read it by.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

struct AxisTick {
  double value;
  std::string label;
};

/// About `wanted` ticks (2 or more) within [low, high], at multiples of 1, 2 or 5 times a power of ten; of a
/// logarithmic scale at powers of ten, and at 2 and 5 times them where there are few. All labels have the
/// same number of decimals. A range without length has the one tick. Requires finite low <= high; of a
/// logarithmic scale above zero.
std::vector<AxisTick> axisTicks(double low, double high, int wanted, bool log_scale);

}  // namespace curvisplat
