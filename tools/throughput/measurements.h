// The results of `bench`: measurements with a name that is stable across versions, a unit, and one number per
// sample.
//
// A name is a path that ends with named parameters: "disk/direct/256KiB/depth:8", "stages/project/threads:2".
// Measurements that could not be made are kept with the reason, so that none is missing without explanation.
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

}  // namespace curvisplat
