// Describes the machine that was measured.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace curvisplat {

struct Machine {
  std::string processor;  // "Intel(R) Xeon(R) Processor @ 2.90GHz"; empty if unknown
  unsigned cores = 1;     // usable by this process
  uint64_t memory_bytes = 0;
  std::string system;       // "Linux 6.1.0"
  std::string file_system;  // of the measured folder: "ext4"

  static Machine here(const std::filesystem::path& folder);
  nlohmann::ordered_json toJson() const;
};

/// MemAvailable of /proc/meminfo in bytes; 0 if unknown.
uint64_t availableMemory();

}  // namespace curvisplat
