// What every `--stats FILE.json` begins with, and how it is written.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string_view>
#include <vector>

namespace curvisplat {

/// {"program", "version", "command": [the arguments], "peak_memory_bytes": VmHWM of this process so far}.
nlohmann::json runStatistics();

/// Since the start of this process, to a hundredth of a second: what the kernel keeps.
double secondsSinceStart();

/// Writes one JSON object, whole or not at all. Throws Error.
void writeStatistics(const std::filesystem::path& path, const nlohmann::json& statistics);

/// Throws Error if the folder that `path`, the value of `option`, is to be written to does not exist or
/// cannot be written to: for use before long work.
void checkOutputFolder(std::string_view option, const std::filesystem::path& path);

/// checkOutputFolder() for a file. Throws Error, too, if `path` is there and is no regular file, or if
/// writing it would change one of `others`: files or caches that are read, or written as well.
void checkOutputFile(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others);

}  // namespace curvisplat
