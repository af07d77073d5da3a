// Where the window keeps what it remembers: $XDG_CONFIG_HOME/curvisplat, else ~/.config/curvisplat.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace curvisplat {

/// Nothing where neither XDG_CONFIG_HOME nor HOME is set.
std::optional<std::filesystem::path> configFolder();

/// The state of this cache's last window: its name, and a hash of where it is.
std::optional<std::filesystem::path> rememberedStateOf(const std::filesystem::path& cache);

/// Writes a function's text into the configuration folder, by its own hash, so that a command that names it
/// stays true. Throws Error where it cannot.
std::filesystem::path keepFunction(const std::string& preset_text);

/// Writes `text`, and makes the folder. Throws Error.
void writeState(const std::filesystem::path& file, const std::string& text);

}  // namespace curvisplat
