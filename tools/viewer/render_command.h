// The `curvisplat render` command that draws what the window shows: short, with numbers that have no more digits than
// can be seen.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/viewer/view_state.h"

namespace curvisplat {

/// What the command draws besides the state.
struct CommandOptions {
  std::filesystem::path cache;
  ImageSize size;
  std::filesystem::path function_file, opacity_file;  // those that needFile() asks for
  bool turns = false;                                 // a movie: once around the focal point
  std::vector<std::filesystem::path> solutions = {};  // where `cache` is a grid: its further files
  bool fine_values = false;                           // of such a grid: --value-precision fine
};

/// Whether options cannot state the function: it has to be in a file (toParaViewPreset()).
bool needsFile(const EditedFunction& function);

/// The shell command. Options that have their defaults are left out.
std::string renderCommand(const ViewState& state, const CommandOptions& options);

/// `path` as seen from the current folder if it lies in there, else as it is.
std::filesystem::path shortPath(const std::filesystem::path& path);

}  // namespace curvisplat
