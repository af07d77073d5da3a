#include "render/annotate/annotated_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace curvisplat {

std::string scalarTitle(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

namespace {

/// The step among 1, 2 and 5 times the powers of ten that comes nearest to `wanted` ticks.
double roundStep(double length, int wanted) {
  const double rough = length / (wanted - 1);
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double lead = rough / power;
  return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

/// A label with enough digits to distinguish neighbours `step` apart; `largest` is the largest magnitude.
std::string labelOf(double value, double step, double largest) {
  const int step_power = static_cast<int>(std::floor(std::log10(step) + 1e-9));
  if (largest < 1e6 && step_power >= -4) return fmt::format("{:.{}f}", value, std::max(0, -step_power));
  const int largest_power = static_cast<int>(std::floor(std::log10(largest) + 1e-9));
  return fmt::format("{:.{}e}", value, std::max(0, largest_power - step_power));
}

std::vector<AxisTick> linearTicks(double low, double high, int wanted) {
  const double largest = std::max(std::abs(low), std::abs(high));
  // The step is below the numbers' precision: adding it would not change them.
  if (!(high - low > 1e-12 * largest)) return {{low, fmt::format("{:g}", low)}};
  const double step = roundStep(high - low, wanted);
  const double slack = 1e-9 * step;  // accepts a tick at an end in spite of rounding
  // One tick does not say how long the axis is.
  if (std::floor((high + slack) / step) - std::ceil((low - slack) / step) < 1)
    return linearTicks(low, high, wanted + 1);
  std::vector<AxisTick> ticks;
  for (double n = std::ceil((low - slack) / step); n * step <= high + slack; ++n) {
    const double value = n == 0 ? 0 : n * step;  // no -0
    ticks.push_back({value, labelOf(value, step, largest)});
  }
  return ticks;
}

std::vector<AxisTick> logTicks(double low, double high, int wanted) {
  const double decades = std::log10(high / low);
  if (decades < 1) return linearTicks(low, high, wanted);
  const double every = std::max(1.0, std::ceil(decades / wanted));
  std::vector<AxisTick> ticks;
  for (double exponent = std::floor(std::log10(low)); exponent <= std::ceil(std::log10(high));
       exponent += every)
    for (const double lead : {1.0, 2.0, 5.0}) {
      const double value = lead * std::pow(10.0, exponent);
      if (lead > 1 && decades * 3 > wanted) continue;
      if (value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9))
        ticks.push_back({value, fmt::format("{:g}", value)});
    }
  return ticks;
}

/// Multiples of powers of ten, of the largest first and those nearest to zero first, each where it has room.
std::vector<AxisTick> asinhTicks(const ScalarAxis& axis, int wanted) {
  constexpr double kReach =
      20;  // multiples of a power on either side of the centre: those further out have no room
  constexpr double kMinStep = 0.1, kMinDistance = 0.7;
  const auto [low, high] = axis.range;
  std::vector<double> places;
  std::vector<AxisTick> ticks;
  const auto add = [&](double value) {
    const double place = axis.fractionOf(value);
    for (const double other : places)
      if (std::abs(place - other) * wanted < kMinDistance) return;
    places.push_back(place);
    ticks.push_back({value, fmt::format("{:g}", value)});
  };
  for (double step = std::pow(10, std::floor(std::log10(std::max(std::abs(low), std::abs(high)))));
       step > kMinStep * axis.asinh->width; step /= 10) {
    const double first = std::ceil(std::max(low, axis.asinh->centre - kReach * step) / step - 1e-9);
    const double last = std::floor(std::min(high, axis.asinh->centre + kReach * step) / step + 1e-9);
    std::vector<double> multiples;
    for (double n = first; n <= last; ++n) multiples.push_back(n == 0 ? 0 : n * step);  // no -0
    std::stable_sort(multiples.begin(), multiples.end(),
                     [](double a, double b) { return std::abs(a) < std::abs(b); });
    for (const double value : multiples) add(value);
  }
  std::sort(ticks.begin(), ticks.end(),
            [](const AxisTick& a, const AxisTick& b) { return a.value < b.value; });
  return ticks;
}

}  // namespace

std::vector<AxisTick> axisTicks(const ScalarAxis& axis, int wanted) {
  const auto [low, high] = axis.range;
  if (!(high > low)) return {{low, fmt::format("{:g}", low)}};
  if (axis.asinh) return asinhTicks(axis, wanted);
  return axis.log_scale ? logTicks(low, high, wanted) : linearTicks(low, high, wanted);
}

}  // namespace curvisplat
