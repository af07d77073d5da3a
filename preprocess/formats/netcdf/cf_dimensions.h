// Finds which of a variable's dimensions are space, and which time, the faces of a grid, or steps of another
// kind (months, members).
#pragma once

#include <cstddef>
#include <optional>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// Whether a dimension of a variable is one of time. An unlimited one without a coordinate is, if the variable
/// has three others: `rank` counts all.
bool isTime(const NetcdfFiles& file, size_t dim, size_t rank);

/// Hours, days and the like, whatever the coordinate is called.
bool hasUnitOfTime(const NetcdfVariable& coordinate);

/// Lead times of a forecast: hours since its start.
bool isLeadTime(const NetcdfFiles& file, size_t dim);

/// The three dimensions in space, the time dimension and that of faces; nullopt if there are more or fewer in
/// space.
std::optional<CfDimensions> dimensionsOf(const NetcdfFiles& file, const NetcdfVariable& variable);

}  // namespace curvisplat
