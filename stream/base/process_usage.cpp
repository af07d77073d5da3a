#include "stream/base/process_usage.h"

#include <time.h>

#include <fstream>
#include <string>

namespace curvisplat {
namespace {

/// The number after `key` in a file of lines "key: number"; 0 if the key is missing.
uint64_t numberIn(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(key)) return std::stoull(line.substr(key.size()));
  return 0;
}

}  // namespace

ProcessUsage ProcessUsage::now() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  ProcessUsage usage;
  usage.cpu_seconds = static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  usage.bytes_read = numberIn("/proc/self/io", "rchar:");
  usage.bytes_written = numberIn("/proc/self/io", "wchar:");
  usage.memory_bytes = 1024 * numberIn("/proc/self/status", "VmRSS:");
  usage.peak_memory_bytes = 1024 * numberIn("/proc/self/status", "VmHWM:");
  return usage;
}

}  // namespace curvisplat
