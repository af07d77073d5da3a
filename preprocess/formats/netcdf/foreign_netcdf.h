// Recognises NetCDF files that hold no structured grid by design: unstructured meshes, and plain HDF5.
#pragma once

#include <optional>
#include <string>

#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// "an unstructured mesh (UGRID)", "an HDF5 file, but not NetCDF-4 or CGNS"; nullopt for any other file.
std::optional<std::string> foreignNetcdf(const NetcdfFiles& file);

}  // namespace curvisplat
