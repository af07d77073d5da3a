// How a command reports what it has found: lines and ranges of values on standard output, and the fields
// that every --stats file has. Any thread may call these functions; lines of several threads may come in any
// order.
#pragma once

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
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

/// A size or a time that is an estimate, with the two digits that one can trust: "94 MiB", "1.2 GiB"; "0.35 s", "12 min".
std::string estimatedBytes(uint64_t bytes);
std::string estimatedTime(double seconds);

/// A range of values as people read it: "-2.5 .. 0"; -0 is printed as 0. Numbers that are too small for single precision stand
/// for smaller ones of the files.
inline std::string rangeText(double min, double max, int digits) {
  constexpr double kSmallest = std::numeric_limits<float>::min();
  const auto text = [digits](double value) {
    if (value == 0 || std::abs(value) >= kSmallest) return fmt::format("{:.{}g}", value + 0.0, digits);
    return std::string(value > 0 ? "below 1.2e-38" : "above -1.2e-38");
  };
  return text(min) + " .. " + text(max);
}

}  // namespace curvisplat
