// Views that are kept: as files, in $XDG_CONFIG_HOME/curvisplat or ~/.config/curvisplat, and as the
// `curvisplat render` command that draws what is shown. The command is short: its numbers have no more
// digits than can be seen.
//
// Files are small and written at once. The functions keep no state: any thread may call them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stream/codec/values_codec.h"
#include "tools/view/view_state.h"

namespace curvisplat {

/// The configuration folder; nullopt if neither XDG_CONFIG_HOME nor HOME is set.
std::optional<std::filesystem::path> configFolder();

/// The state file of this cache, named by the cache's name and a hash of its path; nullopt without a folder.
std::optional<std::filesystem::path> rememberedStateOf(const std::filesystem::path& cache);

/// The file of the film that was made of this cache, beside its state; nullopt without a folder.
std::optional<std::filesystem::path> rememberedFilmOf(const std::filesystem::path& cache);

/// The window's own settings, whatever it shows.
struct WindowSettings {
  bool light_theme = false;
  double text_scale = 1;
  std::vector<std::vector<std::string>>
      recent;                    // what was opened, the newest first: a cache, or a grid's files
  std::string data_folder = {};  // from which the dialog opened data last; empty: it did not

  /// Puts these files at the front; of more than 12 entries the oldest are forgotten.
  void opened(std::vector<std::string> files);
};
/// The settings that were written last; the defaults if there are none, or none that can be read.
WindowSettings readSettings();
/// Throws Error.
void writeSettings(const WindowSettings& settings);

/// The views that were saved for this cache, by name.
std::vector<std::string> savedViewsOf(const std::filesystem::path& cache);
/// The file of a saved view; any text is a name. Throws Error without a configuration folder.
std::filesystem::path savedViewOf(const std::filesystem::path& cache, const std::string& name);

/// Writes `text` to `file` and creates the folder if necessary. Throws Error.
void writeState(const std::filesystem::path& file, const std::string& text);

/// The inputs of the command besides the state.
struct CommandOptions {
  std::filesystem::path cache;
  ImageSize size;
  std::filesystem::path function_file, opacity_file;  // those that needsFile() asks for
  uint64_t turn_frames = 0;                           // of a movie once around the focal point; 0: it is none
  double frames_per_s = kFramesPerSecond;             // of a movie
  std::filesystem::path film = {};                    // a movie: this file's, which has what a Film states
  uint64_t film_frames = 0;
  std::vector<std::filesystem::path> solutions = {};  // where `cache` is a grid: its further files
  ValuePrecision precision = ValuePrecision::kAuto;   // of such a grid: --value-precision
  std::string program = "curvisplat";                 // as programWord()
};

/// Whether options cannot state the function, so that it has to be in a file (toParaViewPreset()).
bool needsFile(const EditedFunction& function);

/// The shell command. Options that have their defaults are left out.
std::string renderCommand(const ViewState& state, const CommandOptions& options);

/// The word that starts this program in a shell: its path, quoted if need be; its name where PATH leads to it.
std::string programWord();

/// `path` as seen from the current folder if it lies in there, else as it is.
std::filesystem::path shortPath(const std::filesystem::path& path);

}  // namespace curvisplat
