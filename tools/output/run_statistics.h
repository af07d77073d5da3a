// What every `--stats FILE.json` begins with, and how it is written.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace curvisplat {

/// {"program", "version", "command": [the arguments], "peak_memory_bytes": VmHWM of this process so far}.
nlohmann::json runStatistics();

/// Since the start of this process, to a hundredth of a second: what the kernel keeps.
double secondsSinceStart();

/// Writes one JSON object, whole or not at all. Throws Error.
void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics);

}  // namespace curvisplat
