#include "render/cpu/shading_table.h"

#include <algorithm>
#include <cmath>

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
    bends_.push_back({static_cast<float>(bend), static_cast<float>(twist)});
    bend += largest(second(n));
    twist += largest(second(n + 1) - second(n));
  }
}

}  // namespace curvisplat
