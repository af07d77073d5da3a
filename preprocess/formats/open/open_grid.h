// Opens a file of any format, structured or unstructured, and matches scalars by name. The format is
// detected by the contents of the file; its name counts only for file series and for HDF5 files named .cgns.
// A file of a format that is not read is refused with the format's name. Any thread may call these
// functions.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Opens the files as a GridSource or a MeshSource. Throws Error with the file, and with what was expected
/// and found.
std::unique_ptr<DataSource> openData(const OpenGridOptions& options);

/// Whether openData() opens this folder, an OpenFOAM case, or refuses it by the name of its format.
bool isGridFolder(const std::filesystem::path& path);

/// Opens a structured grid as openData() does: throws Error for an unstructured one.
std::unique_ptr<GridSource> openGrid(const OpenGridOptions& options);

/// `source` as a structured grid. Throws Error, which says what cannot be done to an unstructured one
/// ("cannot be added to a cache").
std::unique_ptr<GridSource> requireGrid(std::unique_ptr<DataSource> source, const char* cannot);

/// Indices into description.scalars for `names`; each is a name, the number of a function file's variable,
/// or a PLOT3D function number. Without names: the first scalar, if the files hold any. Throws UsageError
/// that lists the available names.
std::vector<uint32_t> scalarsNamed(const GridDescription& description, const std::vector<std::string>& names);

/// One line for each number among `names` that could mean two scalars.
std::vector<std::string> notesOnNumbers(const GridDescription& description,
                                        const std::vector<std::string>& names);

}  // namespace curvisplat
