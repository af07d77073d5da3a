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

// Files of /proc have no size, which stream/file.h goes by.
std::vector<std::string> commandLine() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string argument; std::getline(file, argument, '\0');) arguments.push_back(argument);
  return arguments;
}

/// Field 22 of /proc/self/stat, in clock ticks since the machine's start. Field 2, the program's name in
/// brackets, may hold anything.
double startTicks() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  std::istringstream fields(line.substr(line.rfind(')') + 1));
  std::string field;
  for (int n = 3; n < 22; ++n) fields >> field;
  double ticks = 0;
  if (!(fields >> ticks))
    throw Error("/proc/self/stat: has no field 22, the time at which the process started");
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
    throw Error("/proc/self/status: has no VmHWM, the peak of memory that --stats reports");
  return {{"program", "curvisplat"},
          {"version", CURVISPLAT_VERSION},
          {"command", commandLine()},
          {"peak_memory_bytes", peak_memory_bytes}};
}

void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics) {
  // Arguments are bytes, which need not be the UTF-8 that JSON is.
  constexpr auto kReplace = nlohmann::json::error_handler_t::replace;
  writeFileDurably(path, statistics.dump(2, ' ', false, kReplace) + "\n");
}

}  // namespace curvisplat
