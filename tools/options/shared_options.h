// Options that several commands have. Each is declared here once, so that its help is the same in all of them. `note` ends
// the text with what is one command's own: its default, or what it limits. The commands put the options under headings.
#pragma once

#include <CLI/CLI.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace curvisplat {

/// --size, of a picture.
CLI::Option* addSizeOption(CLI::App& command, std::string& size);
CLI::Option* addLodPixelsOption(CLI::App& command, std::string& pixels, const std::string& note = {});
CLI::Option* addMaxSplatsOption(CLI::App& command, std::optional<std::string>& splats,
                                const std::string& note = {});
CLI::Option* addBackendOption(CLI::App& command, std::string& backend);
CLI::Option* addMemoryOption(CLI::App& command, std::string& bytes, const std::string& note = {});
CLI::Option* addMemoryOption(CLI::App& command, std::optional<std::string>& bytes, const std::string& note);
CLI::Option* addThreadsOption(CLI::App& command, unsigned& threads);
/// --value-precision of a command that converts a grid to show it.
CLI::Option* addValuePrecisionOption(CLI::App& command, std::string& precision);
CLI::Option* addFrameTimeOption(CLI::App& command, std::optional<std::string>& milliseconds,
                                const std::string& note);
CLI::Option* addStepsOption(CLI::App& command, std::optional<std::string>& steps,
                            const std::string& note = {});
/// --source, with files of the grid or without.
CLI::Option* addSourceOption(CLI::App& command, std::vector<std::filesystem::path>& files,
                             const std::string& note = {});
CLI::Option* addStatsOption(CLI::App& command, std::filesystem::path& file);
CLI::Option* addTraceOption(CLI::App& command, std::filesystem::path& file);

}  // namespace curvisplat
