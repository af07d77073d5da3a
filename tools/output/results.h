// How a command reports what it has found: lines and ranges of values on standard output, and the fields
// that every --stats file has. Any thread may call these functions; lines of several threads may come in any
// order.
#pragma once

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

/// {"program", "version", "command": [the arguments], "peak_memory_bytes": VmHWM of this process so far}
/// The last is null and the arguments are empty where there is no /proc.
nlohmann::json runStatistics();

/// Seconds since this process started, with the kernel's resolution of 1/100 s; nullopt without /proc.
std::optional<double> secondsSinceStart();

/// Writes the JSON object atomically. Throws Error.
void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics);

/// Prints one line on standard output. Control characters in names from files, which a terminal would obey,
/// become spaces.
template <typename... Args>
void printLine(fmt::format_string<Args...> format, Args&&... args) {
  fmt::print("{}\n", oneLine(fmt::format(format, std::forward<Args>(args)...)));
}

/// A range of values as people read it: "-2.5 .. 0"; -0 is printed as 0.
inline std::string rangeText(double min, double max, int digits) {
  return fmt::format("{:.{}g} .. {:.{}g}", min + 0.0, digits, max + 0.0, digits);
}

}  // namespace curvisplat
