// Recognises files of formats that are not read, by their first bytes, so that an Error can name them. Those
// that are NetCDF or HDF5 inside are recognised in formats/netcdf/foreign_netcdf.h.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "stream/base/file.h"

namespace curvisplat {

/// "compressed with gzip (decompress it first)", "an XDMF file"; nullopt for a file that may be PLOT3D.
std::optional<std::string> foreignFormat(const InputFile& file);

/// What a folder is that is not read: "a Zarr store, ..."; nullopt for other folders and for files.
std::optional<std::string> foreignFolder(const std::filesystem::path& folder);

}  // namespace curvisplat
