// Opens whatever grid the user names: finds the format, and matches scalars by name.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/globe.h"
#include "preprocess/grid_source.h"
#include "preprocess/plot3d_layout.h"

namespace curvisplat {

struct OpenGridOptions {
  std::filesystem::path grid;
  std::vector<std::filesystem::path> solutions;  // Q and function files; may be empty
  std::filesystem::path temporary_folder;        // ASCII is spooled to binary here; empty: the system's
  Plot3dForce force;                             // what the user says of the layout, over what is detected
  std::optional<uint32_t> time_step = {};        // from 0; none: the first
  std::vector<std::string> function_names = {};  // of function files' variables, over their .nam files
  GlobeOptions globe = {};                       // of grids in degrees
  std::vector<std::string> scalars = {};         // that are wanted: they choose among several grids of a file
};

/// Throws Error naming the file, what was expected and what was found.
std::unique_ptr<GridSource> openGrid(const OpenGridOptions& options);

/// Positions in the description's scalars of `names` (a name, or a number: of a function file's variable, or
/// PLOT3D's of a function); no names: the first scalar, if the files hold any. Throws UsageError that lists
/// the names there are.
std::vector<uint32_t> scalarsNamed(const GridDescription& description, const std::vector<std::string>& names);

/// What a person may not expect of the numbers among `names`: a line for each that means two scalars.
std::vector<std::string> notesOnNumbers(const GridDescription& description,
                                        const std::vector<std::string>& names);

}  // namespace curvisplat
