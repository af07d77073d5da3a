#include "tools/output/results.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/durable_file.h"
#include "stream/base/os.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"

namespace curvisplat {
std::optional<double> secondsSinceStart() {
  return os::secondsSinceStart();
}

nlohmann::json runStatistics() {
  nlohmann::json json{{"program", "curvisplat"},
                      {"version", CURVISPLAT_VERSION},
                      {"command", os::commandLine()},
                      {"peak_memory_bytes", nullptr}};
  if (const uint64_t peak = ProcessUsage::now().peak_memory_bytes) json["peak_memory_bytes"] = peak;
  return json;
}

void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics) {
  // The recorded arguments may not be valid UTF-8, which JSON requires.
  constexpr auto kReplace = nlohmann::json::error_handler_t::replace;
  writeFileDurably(path, statistics.dump(2, ' ', false, kReplace) + "\n");
}

namespace {

double withTwoDigits(double value) {
  if (!(value > 0)) return 0;
  const double digit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return std::round(value / digit) * digit;
}

}  // namespace

std::string estimatedBytes(uint64_t bytes) {
  // byteText() takes the next unit from where it would print 1024.
  double unit = 1;
  while (static_cast<double>(bytes) >= 1023.5 * unit && unit < 0x1p60) unit *= 1024;
  return byteText(static_cast<uint64_t>(std::round(withTwoDigits(static_cast<double>(bytes) / unit) * unit)));
}

std::string estimatedTime(double seconds) {
  if (seconds < 100) return fmt::format("{:g} s", withTwoDigits(seconds));
  if (seconds < 6000) return fmt::format("{:g} min", withTwoDigits(seconds / 60));
  return fmt::format("{:g} h", withTwoDigits(seconds / 3600));
}

}  // namespace curvisplat
