#include <array>
#include <cmath>

#include "render/cpu/tile.h"
#include "render/project/kernel.h"

namespace curvisplat {
namespace {

using Polynomial = std::array<double, kFootprintTerms>;

/// Through F / x² at Chebyshev's points: Newton's divided differences, multiplied out.
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
