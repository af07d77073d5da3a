#include "render/surface/colour_table.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace curvisplat {

ColourTable::ColourTable(const TransferFunction& function) : log_scale_(function.logScale()) {
  const auto [from, to] = function.range();
  low_ = log_scale_ ? std::log(from) : from;
  const double high = log_scale_ ? std::log(to) : to;
  scale_ = high > low_ ? kCells / (high - low_) : 0;
  values_.reserve(kCells + 1);
  for (int n = 0; n <= kCells; ++n) {
    const double x = low_ + (high - low_) * n / kCells;
    const TransferFunction::Value value = function.at(log_scale_ ? std::exp(x) : x);
    values_.emplace_back(glm::vec3(value.colour), -std::expm1(-value.extinction * function.opacityUnit()));
  }
}

glm::vec4 ColourTable::valueAt(double scalar) const {
  constexpr double kMin = 1e-300;
  const double v = log_scale_ ? std::log(std::max(scalar, kMin)) : scalar;
  const double x = std::clamp((v - low_) * scale_, 0.0, double{kCells});
  const int cell = std::min(static_cast<int>(x), kCells - 1);
  return glm::mix(values_[static_cast<size_t>(cell)], values_[static_cast<size_t>(cell) + 1],
                  static_cast<float>(x - cell));
}

}  // namespace curvisplat
