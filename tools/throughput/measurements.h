// What was measured: a name that stays the same from version to version, a unit, and one number a sample.
//
// A name is a path, its parameters last and named: "disk/direct/256KiB/depth:8", "stages/project/threads:2".
// What could not be measured is kept as well, with the reason: a row is never missing without a word.
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

  /// Of a rate more is better, of seconds and bytes less.
  bool moreIsBetter() const;
};

/// The middle sample, or the mean of the two in the middle. At least one.
double medianOf(std::vector<double> samples);

/// Half the distance from the smallest to the largest sample, as a part of the median; 0 of one sample.
double spreadOf(const std::vector<double>& samples);

class Measurements {
 public:
  /// At least one sample, each finite; a name comes once.
  void add(std::string name, std::string unit, std::vector<double> samples);
  void leaveOut(std::string name, std::string reason);

  struct LeftOut {
    std::string name, reason;
  };
  const std::vector<Measurement>& all() const { return all_; }
  const std::vector<LeftOut>& leftOut() const { return left_out_; }

  const Measurement* find(std::string_view name) const;
  /// Nothing where it was not measured.
  std::optional<double> median(std::string_view name) const;

  /// [{"name", "unit", "better": "more" or "less", "median", "samples": [...]}]
  nlohmann::ordered_json toJson() const;
  /// [{"name", "reason"}]
  nlohmann::ordered_json leftOutAsJson() const;

 private:
  std::vector<Measurement> all_;
  std::vector<LeftOut> left_out_;
};

}  // namespace curvisplat
