// Positive numbers as whole steps of their logarithms, and back: logCodes() for the encoder, LogTable for
// both the encoder and the decoder. What a code stands for is part of the format (stream/FORMAT.md, "Tables
// of exponentials"): all programs get the same bits. Pure functions and immutable tables: any thread may use
// them.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace curvisplat {

struct LogCodes {
  double lowest = 0;     // the logarithm that code 0 stands for: the smallest value's
  uint32_t largest = 0;  // no code is larger
};

/// codes[n] = (log(values[n]) - lowest) / step, rounded, by std::log(). Vector instructions compute several
/// at once; their logarithms differ from std::log() in the last bits, so std::log() decides where that
/// leaves the code in doubt. `values`: none is negative or NaN. nullopt, with unspecified `codes`, if a code
/// would reach `too_large` or a logarithm is not finite.
std::optional<LogCodes> logCodes(std::span<const double> values, double step, uint32_t too_large,
                                 uint32_t* codes);

/// e^(base + n step) for whole n, as the product of two entries of small tables, which is faster than an
/// exponential. Its rounding is part of the format.
class LogTable {
 public:
  LogTable() = default;
  /// Holds the powers for n from 0 to `largest`. Costs about 64 + largest / 64 exponentials.
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
