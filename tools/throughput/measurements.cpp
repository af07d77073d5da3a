#include "tools/throughput/measurements.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {

using Json = nlohmann::ordered_json;

bool Measurement::moreIsBetter() const {
  return unit.ends_with("/s");
}

double medianOf(std::vector<double> samples) {
  CURVISPLAT_CHECK(!samples.empty());
  std::sort(samples.begin(), samples.end());
  const size_t half = samples.size() / 2;
  return samples.size() % 2 ? samples[half] : (samples[half - 1] + samples[half]) / 2;
}

double spreadOf(const std::vector<double>& samples) {
  const double median = medianOf(samples);
  const auto [least, most] = std::minmax_element(samples.begin(), samples.end());
  return median > 0 ? (*most - *least) / 2 / median : 0;
}

void Measurements::add(std::string name, std::string unit, std::vector<double> samples) {
  CURVISPLAT_CHECK(!samples.empty() && !find(name));
  for (const double sample : samples) CURVISPLAT_CHECK(std::isfinite(sample));
  all_.push_back({std::move(name), std::move(unit), std::move(samples)});
}

void Measurements::leaveOut(std::string name, std::string reason) {
  left_out_.push_back({std::move(name), std::move(reason)});
}

const Measurement* Measurements::find(std::string_view name) const {
  const auto found =
      std::find_if(all_.begin(), all_.end(), [&](const auto& one) { return one.name == name; });
  return found == all_.end() ? nullptr : &*found;
}

std::optional<double> Measurements::median(std::string_view name) const {
  const Measurement* const found = find(name);
  if (!found) return std::nullopt;
  return medianOf(found->samples);
}

Json Measurements::toJson() const {
  Json json = Json::array();
  for (const Measurement& one : all_)
    json.push_back({{"name", one.name},
                    {"unit", one.unit},
                    {"better", one.moreIsBetter() ? "more" : "less"},
                    {"median", medianOf(one.samples)},
                    {"samples", one.samples}});
  return json;
}

Json Measurements::leftOutAsJson() const {
  Json json = Json::array();
  for (const LeftOut& one : left_out_) json.push_back({{"name", one.name}, {"reason", one.reason}});
  return json;
}

}  // namespace curvisplat
