#include "tools/output/results.h"

#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <vector>

#include "stream/base/durable_file.h"
#include "stream/base/os.h"
#include "stream/base/progress.h"

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

}  // namespace curvisplat
