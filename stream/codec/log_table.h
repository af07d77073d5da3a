// e^(base + n step) for whole n, as the product of two entries of small tables. Faster than an exponential,
// and the rounding is part of the format: encoder and decoder get the same bits (stream/FORMAT.md, "Tables of
// exponentials").
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

namespace curvisplat {

class LogTable {
 public:
  LogTable() = default;
  /// For n from 0 to `largest`. Costs about 64 + largest / 64 exponentials.
  LogTable(double base, double step, uint32_t largest) : coarse_((largest >> kFineBits) + 1), fine_(kFine) {
    for (uint32_t n = 0; n < kFine; ++n) fine_[n] = std::exp(n * step);
    for (uint32_t n = 0; n < coarse_.size(); ++n) coarse_[n] = std::exp(base + n * (kFine * step));
  }

  double operator[](uint32_t n) const { return coarse_[n >> kFineBits] * fine_[n & (kFine - 1)]; }

 private:
  static constexpr uint32_t kFineBits = 6, kFine = 1u << kFineBits;
  std::vector<double> coarse_, fine_;
};

}  // namespace curvisplat
