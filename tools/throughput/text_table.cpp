#include "tools/throughput/text_table.h"

#include <fmt/format.h>

#include <algorithm>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

/// Width on a terminal, in characters: continuation bytes of UTF-8 do not count.
size_t widthOf(const std::string& text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string threeDigits(double value) {
  return fmt::format("{:.{}f}", value, value < 9.995 ? 2 : value < 99.95 ? 1 : 0);
}

/// With a unit prefix for powers of 1000.
std::string scaled(double value) {
  for (const auto& [size, letter] : {std::pair{1e12, "T"}, {1e9, "G"}, {1e6, "M"}, {1e3, "k"}})
    if (value >= size) return threeDigits(value / size) + " " + letter;
  return fmt::format("{:.0f} ", value);
}

}  // namespace

std::string TextTable::text() const {
  std::vector<size_t> widths;
  for (const auto& row : rows_) {
    CURVISPLAT_CHECK_OP(row.size(), <=, rows_.front().size());
    widths.resize(std::max(widths.size(), row.size()));
    for (size_t n = 0; n < row.size(); ++n) widths[n] = std::max(widths[n], widthOf(row[n]));
  }
  std::string text;
  for (const auto& row : rows_) {
    std::string line;
    for (size_t n = 0; n < row.size(); ++n) {
      const std::string blanks(widths[n] - widthOf(row[n]), ' ');
      if (n > 0) line += "  ";
      line += n == 0 ? row[n] + blanks : blanks + row[n];
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string shortCount(double value) {
  std::string text = scaled(value);
  if (text.ends_with(' ')) text.pop_back();
  return text;
}

std::string shortBytes(double bytes) {
  return scaled(bytes) + "B";
}

std::string shortSeconds(double seconds) {
  if (seconds < 0.0995) return threeDigits(1e3 * seconds) + " ms";
  return threeDigits(seconds) + " s";
}

}  // namespace curvisplat
