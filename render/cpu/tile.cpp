// The tables that tiles are painted with; paint_tile.cpp paints them.
#include "render/cpu/tile.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "render/project/footprint.h"

namespace curvisplat {
namespace {

ShadingTable::Value toValue(const glm::dvec4& v) {
  return {
      {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), static_cast<float>(v.w)}};
}

double largest(const glm::dvec4& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z), std::abs(v.w)});
}

}  // namespace

ShadingTable::ShadingTable(const ClassificationTable& table)
    : log_scale_(table.logScale()), scale_(table.scale()), bias_(table.bias()) {
  constexpr int kCells = ClassificationTable::kCells;
  const std::span<const glm::dvec4> integral = table.exactCumulative();
  const auto density = [&](int n) {
    if (n < 0) return glm::dvec4(table.below());
    if (n >= kCells) return glm::dvec4(table.above());
    return integral[static_cast<size_t>(n) + 1] - integral[static_cast<size_t>(n)];
  };
  const auto start = [&](int n) {
    if (n < 0) return -density(n);
    if (n > kCells) return integral.back() + density(n);
    return integral[static_cast<size_t>(n)];
  };
  const auto second = [&](int n) { return density(n + 1) - 2.0 * density(n) + density(n - 1); };
  double bend = 0, twist = 0;
  for (int n = -1; n <= kCells + 1; ++n) {
    cells_.push_back({toValue(start(n)), toValue(density(n))});
    most_extinction_ = std::max(most_extinction_, cells_.back().density.of[3]);
    bends_.push_back({static_cast<float>(bend), static_cast<float>(twist)});
    bend += largest(second(n));
    twist += largest(second(n + 1) - second(n));
  }
}

namespace {

using Polynomial = std::array<double, kFootprintTerms>;

/// The polynomial through F / x² at Chebyshev's points: Newton's divided differences, multiplied out.
Polynomial interpolate() {
  Polynomial at, value;
  for (size_t n = 0; n < kFootprintTerms; ++n) {
    at[n] = 0.5 - 0.5 * std::cos(M_PI * (static_cast<double>(n) + 0.5) / kFootprintTerms);
    value[n] = footprint(kKernelSupport * std::sqrt(1 - at[n])) / (at[n] * at[n]);
  }
  for (size_t order = 1; order < kFootprintTerms; ++order)
    for (size_t n = kFootprintTerms - 1; n >= order; --n)
      value[n] = (value[n] - value[n - 1]) / (at[n] - at[n - order]);
  Polynomial result{};
  for (size_t n = kFootprintTerms; n-- > 0;) {
    for (size_t power = kFootprintTerms - 1; power > 0; --power)
      result[power] = result[power - 1] - at[n] * result[power];
    result[0] = value[n] - at[n] * result[0];
  }
  return result;
}

}  // namespace

const float* footprintPolynomial() {
  static const std::array<float, kFootprintTerms> coefficients = [] {
    std::array<float, kFootprintTerms> rounded;
    const Polynomial exact = interpolate();
    for (size_t n = 0; n < kFootprintTerms; ++n) rounded[n] = static_cast<float>(exact[n]);
    return rounded;
  }();
  return coefficients.data();
}

}  // namespace curvisplat
