// Opens whatever grid the user names: finds the format, and matches scalars by name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

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
