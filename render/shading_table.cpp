#include "render/shading_table.h"

#include <cmath>

namespace curvisplat {
namespace {

ShadingTable::Value toValue(const glm::dvec4& v) {
  return {
      {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), static_cast<float>(v.w)}};
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
  double bend = 0;
  for (int n = -1; n <= kCells + 1; ++n) {
    cells_.push_back({toValue(start(n)), toValue(density(n))});
    bend_.push_back(static_cast<float>(bend));
    const glm::dvec4 difference = density(n + 1) - 2.0 * density(n) + density(n - 1);
    double largest = 0;
    for (int c = 0; c < 4; ++c) largest = std::max(largest, std::abs(difference[c]));
    bend += largest;
  }
}

}  // namespace curvisplat
