#include "tools/output/results.h"

#include <time.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "stream/base/durable_file.h"
#include "stream/base/progress.h"

namespace curvisplat {
namespace {

// The command line, read without stream/base/file.h, which reads as many bytes as the file's size: files of
// /proc have size 0.
std::vector<std::string> commandLine() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string argument; std::getline(file, argument, '\0');) arguments.push_back(argument);
  return arguments;
}

/// Start time of this process in clock ticks since boot: field 22 of /proc/self/stat. Counts the fields from
/// the last bracket on, because field 2, the program's name in brackets, may contain spaces and brackets.
std::optional<double> startTicks() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  std::istringstream fields(line.substr(line.rfind(')') + 1));
  std::string field;
  for (int n = 3; n < 22; ++n) fields >> field;
  double ticks = 0;
  if (!(fields >> ticks)) return std::nullopt;
  return ticks;
}

}  // namespace

std::optional<double> secondsSinceStart() {
  const std::optional<double> start = startTicks();
  if (!start) return std::nullopt;
  timespec now;
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) -
         *start / static_cast<double>(sysconf(_SC_CLK_TCK));
}

nlohmann::json runStatistics() {
  nlohmann::json json{{"program", "curvisplat"},
                      {"version", CURVISPLAT_VERSION},
                      {"command", commandLine()},
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
