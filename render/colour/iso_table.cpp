#include "render/colour/iso_table.h"

#include <algorithm>
#include <cmath>

#include "stream/base/check.h"

namespace curvisplat {

IsoTable IsoTable::of(const TransferFunction& function, std::span<const double> values, double depth,
                      double data_low, double data_high, bool with_volume) {
  CURVISPLAT_CHECK(!values.empty());
  CURVISPLAT_CHECK(!with_volume || !function.logScale());
  const double range = data_high > data_low ? data_high - data_low : std::max(std::abs(data_low), 1.0) * 1e-3;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  const double margin = 0.01 * range;
  // Without a volume the table has the isovalues alone: outside it is clear.
  double low = *least - margin, high = *most + margin, scale = 1, offset = 0, boundary = low;
  if (with_volume) {
    low = std::clamp(function.range().first, data_low - 0.25 * range, data_high + 0.25 * range);
    boundary = data_high + range;
    const double of_volume = boundary - low, of_iso = *most + margin - (data_low - range);
    scale = of_volume / of_iso;
    offset = boundary - scale * (data_low - range);
    high = boundary + of_volume;
  }
  const double cell = (high - low) / ClassificationTable::kCells;
  const auto cellOf = [&](double x) { return std::floor((x - low) / cell); };
  const auto at = [&](double x) -> TransferFunction::Value {
    if (with_volume && x < boundary) return function.at(x);
    if (x >= high) return {};
    for (const double value : values)
      if (cellOf(scale * value + offset) == cellOf(x))
        return {function.at(value).colour, depth * scale / cell};
    return {};
  };
  return {ClassificationTable(at, low, high), scale, offset};
}

}  // namespace curvisplat
