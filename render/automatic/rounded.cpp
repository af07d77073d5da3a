#include "render/automatic/rounded.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

namespace curvisplat {

double roundedTo(double value, double scale, int digits) {
  if (!(scale > 0) || !std::isfinite(value)) return value;
  const int last =
      static_cast<int>(std::floor(std::log10(scale))) - digits + 1;  // exponent of the last digit
  const double magnitude = std::abs(value);
  if (magnitude < 0.5 * std::pow(10, last)) return 0;
  const int own = static_cast<int>(std::floor(std::log10(magnitude)));
  const std::string text = fmt::format("{:.{}e}", value, std::clamp(own - last, 0, 17));
  double result = value;
  std::from_chars(text.data(), text.data() + text.size(), result);
  return result;
}

}  // namespace curvisplat
