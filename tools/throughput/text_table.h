// A table for a terminal: columns as wide as their widest cell, the first to the left, the others to the
// right. Pure.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

class TextTable {
 public:
  explicit TextTable(std::vector<std::string> heads) : rows_{std::move(heads)} {}

  /// As many cells as there are heads, or fewer.
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  bool empty() const { return rows_.size() == 1; }

  /// A line a row, without blanks at their ends.
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// "17.3 M", "940 k", "12": three digits or so.
std::string shortCount(double value);
/// "1.8 GB/s" of 1.8e9: powers of 1000.
std::string shortBytes(double bytes);
/// "12.3 ms", "0.42 s", "17 s".
std::string shortSeconds(double seconds);

}  // namespace curvisplat
