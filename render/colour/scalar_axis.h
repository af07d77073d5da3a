// How a transfer function divides its range: linearly, in the logarithm, or in asinh. Plain values; any thread.
#pragma once

#include <optional>
#include <utility>

namespace curvisplat {

/// Divides a range in asinh((f - centre) / width) in place of f: linear within `width` of the centre,
/// logarithmic further out.
struct AsinhScale {
  double centre = 0, width = 1;  // width > 0

  double coordinate(double scalar) const;
  double scalar(double coordinate) const;
};

/// A range of a scalar, and where along it each value lies: 0 at its lower end, 1 at its upper.
struct ScalarAxis {
  std::pair<double, double> range{0, 1};  // increasing; above zero if the scale is logarithmic
  bool log_scale = false;
  std::optional<AsinhScale> asinh = std::nullopt;  // instead

  /// Either may lie outside.
  double fractionOf(double scalar) const;
  double scalarAt(double fraction) const;
};

}  // namespace curvisplat
