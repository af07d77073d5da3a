#include "tools/throughput/measurements.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/error.h"

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

namespace {

/// Width on a terminal, in characters: continuation bytes of UTF-8 do not count.
size_t widthOf(const std::string& text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string threeDigits(double value) {
  return fmt::format("{:.{}f}", value, value < 9.995 ? 2 : value < 99.95 ? 1 : 0);
}

/// The number with a unit prefix for powers of 1000.
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
