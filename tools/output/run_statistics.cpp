#include "tools/output/run_statistics.h"

#include <time.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/process_usage.h"

namespace curvisplat {
namespace {

// Not with stream/base/file.h, which reads as many bytes as the file's size: files of /proc have size 0.
std::vector<std::string> commandLine() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string argument; std::getline(file, argument, '\0');) arguments.push_back(argument);
  return arguments;
}

/// Start time of this process in clock ticks since boot: field 22 of /proc/self/stat. Counts the fields from
/// the last bracket on, because field 2, the program's name in brackets, may contain spaces and brackets.
double startTicks() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  std::istringstream fields(line.substr(line.rfind(')') + 1));
  std::string field;
  for (int n = 3; n < 22; ++n) fields >> field;
  double ticks = 0;
  if (!(fields >> ticks)) throw Error("/proc/self/stat: cannot read field 22, the start time of the process");
  return ticks;
}

}  // namespace

double secondsSinceStart() {
  timespec now;
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) -
         startTicks() / static_cast<double>(sysconf(_SC_CLK_TCK));
}

nlohmann::json runStatistics() {
  const uint64_t peak_memory_bytes = ProcessUsage::now().peak_memory_bytes;
  if (peak_memory_bytes == 0)
    throw Error("/proc/self/status: cannot read VmHWM, the peak memory that --stats reports");
  return {{"program", "curvisplat"},
          {"version", CURVISPLAT_VERSION},
          {"command", commandLine()},
          {"peak_memory_bytes", peak_memory_bytes}};
}

void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics) {
  // The recorded arguments may not be valid UTF-8, which JSON requires.
  constexpr auto kReplace = nlohmann::json::error_handler_t::replace;
  writeFileDurably(path, statistics.dump(2, ' ', false, kReplace) + "\n");
}

}  // namespace curvisplat
