#include "tools/throughput/machine.h"

#include <sys/utsname.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tools/throughput/page_cache.h"

namespace curvisplat {
namespace {

/// The value of the first line "key : value" of a file of /proc; empty if there is none.
std::string valueIn(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const size_t colon = line.find(':');
    const size_t begin = line.find_first_not_of(" \t", colon + 1);
    if (colon != std::string::npos && begin != std::string::npos) return line.substr(begin);
  }
  return {};
}

uint64_t kibibytesIn(const std::string& key) {
  const std::string value = valueIn("/proc/meminfo", key);
  return value.empty() ? 0 : 1024 * std::stoull(value);
}

}  // namespace

Machine Machine::here(const std::filesystem::path& folder) {
  Machine machine;
  machine.processor = valueIn("/proc/cpuinfo", "model name");
  machine.cores = std::max(1u, std::thread::hardware_concurrency());
  machine.memory_bytes = kibibytesIn("MemTotal");
  utsname name{};
  if (::uname(&name) == 0) machine.system = std::string(name.sysname) + " " + name.release;
  machine.file_system = fileSystemOf(folder);
  return machine;
}

nlohmann::ordered_json Machine::toJson() const {
  return {{"processor", processor},
          {"cores", cores},
          {"memory_bytes", memory_bytes},
          {"system", system},
          {"file_system", file_system}};
}

uint64_t availableMemory() {
  return kibibytesIn("MemAvailable");
}

}  // namespace curvisplat
