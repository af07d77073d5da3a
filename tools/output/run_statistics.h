// The fields that every --stats file has, and writing such a file.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

namespace curvisplat {

/// {"program", "version", "command": [the arguments], "peak_memory_bytes": VmHWM of this process so far}
/// The last is null and the arguments are empty where there is no /proc.
nlohmann::json runStatistics();

/// Seconds since this process started, with the kernel's resolution of 1/100 s; nullopt without /proc.
std::optional<double> secondsSinceStart();

/// Writes the JSON object atomically. Throws Error.
void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics);

}  // namespace curvisplat
