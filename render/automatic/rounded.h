// Numbers of few digits, for options that people read and type.
#pragma once

namespace curvisplat {

/// `value` rounded to `digits` decimal digits of `scale` (> 0): 0.1234 for (0.12344, 0.5, 4). The result is the
/// double nearest to the decimal number, so that it prints with few digits.
double roundedTo(double value, double scale, int digits);

}  // namespace curvisplat
