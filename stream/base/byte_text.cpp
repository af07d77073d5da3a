#include "stream/base/byte_text.h"

#include <fmt/format.h>

#include <array>

#include "stream/base/count_text.h"

namespace curvisplat {

std::string byteText(uint64_t bytes) {
  constexpr std::array kUnits = {"KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
  if (bytes < 1024) return countText(bytes, "byte");
  double size = static_cast<double>(bytes) / 1024;
  size_t unit = 0;
  // What would be printed as 1024 has four digits too; from there on the next unit is shorter.
  for (; size >= 1023.5 && unit + 1 < kUnits.size(); ++unit) size /= 1024;
  return fmt::format("{:.4g} {}", size, kUnits[unit]);
}

}  // namespace curvisplat
