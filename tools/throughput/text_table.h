// Formats a table for a terminal. The first column is aligned to the left, the others to the right. Pure.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

class TextTable {
 public:
  explicit TextTable(std::vector<std::string> heads) : rows_{std::move(heads)} {}

  /// At most as many cells as there are heads.
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  bool empty() const { return rows_.size() == 1; }

  /// One line per row, without trailing blanks.
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// About three significant digits: "17.3 M", "940 k", "12".
std::string shortCount(double value);
/// Units of powers of 1000: "1.80 GB" for 1.8e9.
std::string shortBytes(double bytes);
/// "12.3 ms", "0.42 s", "17 s".
std::string shortSeconds(double seconds);

}  // namespace curvisplat
