// Grid files of FV3, MOM6 and FMS (C96_grid.tile1.nc, ocean_hgrid.nc). Their x and y are the longitudes and latitudes of a
// supergrid of twice the resolution, here of 2x1 cells with corners o, centres + and the middles of edges .:
//
//   o . o . o    C96_mosaic.nc names the grid files of all tiles; grid_spec.nc of a coupled model the mosaics of
//   . + . + .    its components.
//   o . o . o
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "preprocess/formats/netcdf/cf_roles.h"
#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// The longitude or latitude (`role`) of a supergrid in another file than the variable's; nullopt if there is none that fits the
/// variable's dimensions.
std::optional<CfTerm> supergridOf(const NetcdfFiles& file, const NetcdfVariable& variable,
                                  const CfDimensions& dims, CfRole role);

/// The files with the grid files that any mosaic among them names, itself or by the mosaics of a coupled model's components, which
/// are expected beside it. Of components, the one with tiles if files are tiles, else the one without. Throws Error if one of the
/// files is not there, or if several components fit.
std::vector<std::filesystem::path> withGridsOfMosaics(const std::vector<std::filesystem::path>& files);

}  // namespace curvisplat
