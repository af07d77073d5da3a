// The machine that was measured, in words.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace curvisplat {

struct Machine {
  std::string processor;  // "Intel(R) Xeon(R) Processor @ 2.90GHz"; empty if the system does not tell
  unsigned cores = 1;     // that this process may use
  uint64_t memory_bytes = 0;
  std::string system;       // "Linux 6.1.0"
  std::string file_system;  // of the folder that was measured: "ext4"

  static Machine here(const std::filesystem::path& folder);
  nlohmann::ordered_json toJson() const;
};

/// What the system could still give to programs, the page cache included. 0 if it does not tell.
uint64_t availableMemory();

}  // namespace curvisplat
