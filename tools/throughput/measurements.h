// The results of `bench`: measurements with a name that is stable across versions, a unit, and one number
// per sample; and tables of them for a terminal.
//
// A name is a path that ends with named parameters: "disk/direct/256KiB/depth:8",
// "stages/project/threads:2". Measurements that could not be made are kept with the reason, so that none is
// missing without explanation. One thread at a time may use an object.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

struct Measurement {
  std::string name;
  std::string unit;  // "B/s", "splats/s", "nodes/s", "s", "B"
  std::vector<double> samples;

  /// True for rates; false for seconds and bytes.
  bool moreIsBetter() const;
};

/// The median. Requires at least one sample.
double medianOf(std::vector<double> samples);

/// Half the distance from the smallest to the largest sample, as a fraction of the median; 0 for one sample.
double spreadOf(const std::vector<double>& samples);

class Measurements {
 public:
  /// Requires at least one sample, finite samples, and a new name.
  void add(std::string name, std::string unit, std::vector<double> samples);
  void leaveOut(std::string name, std::string reason);

  struct LeftOut {
    std::string name, reason;
  };
  const std::vector<Measurement>& all() const { return all_; }
  const std::vector<LeftOut>& leftOut() const { return left_out_; }

  const Measurement* find(std::string_view name) const;
  /// nullopt if it was not measured.
  std::optional<double> median(std::string_view name) const;

  /// [{"name", "unit", "better": "more" or "less", "median", "samples": [...]}]
  nlohmann::ordered_json toJson() const;
  /// [{"name", "reason"}]
  nlohmann::ordered_json leftOutAsJson() const;

 private:
  std::vector<Measurement> all_;
  std::vector<LeftOut> left_out_;
};

/// A table for a terminal. The first column is aligned to the left, the others to the right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> heads) : rows_{std::move(heads)} {}

  /// Adds a row of at most as many cells as there are heads.
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
