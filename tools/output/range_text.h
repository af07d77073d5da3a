// Ranges of values, for people.
#pragma once

#include <fmt/format.h>

#include <string>

namespace curvisplat {

/// "-2.5 .. 0": -0 is 0.
inline std::string rangeText(double min, double max, int digits) {
  return fmt::format("{:.{}g} .. {:.{}g}", min + 0.0, digits, max + 0.0, digits);
}

}  // namespace curvisplat
