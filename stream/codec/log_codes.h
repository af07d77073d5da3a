// Positive numbers as whole steps of their logarithms.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace curvisplat {

struct LogCodes {
  double lowest = 0;     // the logarithm that code 0 stands for: the smallest value's
  uint32_t largest = 0;  // no code is larger
};

/// codes[n] = (log(values[n]) - lowest) / step, rounded, by std::log(). Several at once, by vector instructions: where their
/// logarithms, which differ in the last bits, leave the code in doubt, std::log() decides. `values`: none is negative or NaN. None, and
/// `codes` are of no use, if they are to reach `too_large` steps, or the logarithm of one is not finite. Pure: any thread.
std::optional<LogCodes> logCodes(std::span<const double> values, double step, uint32_t too_large,
                                 uint32_t* codes);

}  // namespace curvisplat
