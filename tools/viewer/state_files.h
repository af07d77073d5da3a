// The files in which the window keeps its state: in $XDG_CONFIG_HOME/curvisplat, else ~/.config/curvisplat.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace curvisplat {

/// The configuration folder; nullopt if neither XDG_CONFIG_HOME nor HOME is set.
std::optional<std::filesystem::path> configFolder();

/// The state file of this cache, named by the cache's name and a hash of its path; nullopt without a folder.
std::optional<std::filesystem::path> rememberedStateOf(const std::filesystem::path& cache);

/// What the window remembers of itself, whatever it shows.
struct WindowSettings {
  bool light_theme = false;
  double text_scale = 1;
  std::vector<std::vector<std::string>>
      recent;  // what was opened, the newest first: a cache, or a grid's files

  /// Puts it at the front; of more than 12 the oldest are forgotten.
  void opened(std::vector<std::string> files);
};
/// The defaults if there are none, or none that can be read.
WindowSettings readSettings();
/// Throws Error.
void writeSettings(const WindowSettings& settings);

/// The views that were saved for this cache, by name.
std::vector<std::string> savedViewsOf(const std::filesystem::path& cache);
/// The file of one; any text is a name. Throws Error without a configuration folder.
std::filesystem::path savedViewOf(const std::filesystem::path& cache, const std::string& name);

/// Writes `text` to `file` and creates the folder if necessary. Throws Error.
void writeState(const std::filesystem::path& file, const std::string& text);

}  // namespace curvisplat
