// The files in which the window keeps its state: in $XDG_CONFIG_HOME/curvisplat, else ~/.config/curvisplat.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace curvisplat {

/// The configuration folder; nullopt if neither XDG_CONFIG_HOME nor HOME is set.
std::optional<std::filesystem::path> configFolder();

/// The state file of this cache, named by the cache's name and a hash of its path; nullopt without a folder.
std::optional<std::filesystem::path> rememberedStateOf(const std::filesystem::path& cache);

/// Writes a transfer function to the configuration folder under the hash of its text, so that commands that
/// refer to it stay valid. Returns its path. Throws Error.
std::filesystem::path keepFunction(const std::string& preset_text);

/// Writes `text` to `file` and creates the folder if necessary. Throws Error.
void writeState(const std::filesystem::path& file, const std::string& text);

}  // namespace curvisplat
