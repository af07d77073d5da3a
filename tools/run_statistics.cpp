#include "tools/run_statistics.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <vector>

#include "stream/error.h"
#include "stream/file.h"

namespace curvisplat {
namespace {

// Files of /proc have no size, which stream/file.h goes by.
std::vector<std::string> commandLine() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string argument; std::getline(file, argument, '\0');) arguments.push_back(argument);
  return arguments;
}

uint64_t peakMemoryBytes() {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) * 1024;
  throw Error("/proc/self/status: has no VmHWM, the peak of memory that --stats reports");
}

}  // namespace

nlohmann::json runStatistics() {
  return {{"program", "curvisplat"},
          {"version", CURVISPLAT_VERSION},
          {"command", commandLine()},
          {"peak_memory_bytes", peakMemoryBytes()}};
}

void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics) {
  // Arguments are bytes, which need not be the UTF-8 that JSON is.
  constexpr auto kReplace = nlohmann::json::error_handler_t::replace;
  writeFileAtomically(path, statistics.dump(2, ' ', false, kReplace) + "\n");
}

void checkOutputFolder(std::string_view option, const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored))
    throw Error("{} {}: there is no folder {}; make it first", option, path.string(), folder.string());
}

}  // namespace curvisplat
