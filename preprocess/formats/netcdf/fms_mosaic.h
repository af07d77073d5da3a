// Mosaics of FV3, MOM6 and FMS: tiles in files of their own, and grid files apart from the data
// (C96_grid.tile1.nc, ocean_hgrid.nc). C96_mosaic.nc names the grid files of all tiles; grid_spec.nc of a
// coupled model names the mosaics of its components. In a grid file, x and y are the longitudes and
// latitudes of a supergrid of twice the resolution, here of 2x1 cells with corners o, centres + and the
// middles of edges .:
//
//   o . o . o    Only files beside a mosaic are opened: one that names others must not reach elsewhere.
//   . + . + .    These functions read metadata alone, and any thread may call them.
//   o . o . o
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// The longitude or latitude (`role`) of a supergrid in another file than the variable's; nullopt if there
/// is none that fits the variable's dimensions.
std::optional<CfTerm> supergridOf(const NetcdfFiles& file, const NetcdfVariable& variable,
                                  const CfDimensions& dims, CfRole role);

/// Adds to the files the grid files that any mosaic among them names, itself or by the mosaics of a coupled
/// model's components. If there are several components, it is the one with tiles if the files are tiles,
/// else the one without. Throws Error if a grid file does not exist, or if several components fit.
std::vector<std::filesystem::path> withGridsOfMosaics(const std::vector<std::filesystem::path>& files);

/// The number of the tile in the name of its file, "NAME.tile3.nc" or "tile3.nc"; nullopt if the name has
/// none.
std::optional<uint32_t> tileNumber(const std::filesystem::path& path);

}  // namespace curvisplat
