// What a NetCDF variable is by the CF conventions: longitude, latitude, depth, time, or none of them.
#pragma once

#include <optional>
#include <string>

#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

enum class CfRole {
  kNone,
  kLongitude,  // degrees
  kLatitude,
  kX,  // of a projection, a length
  kY,
  kVertical,  // depth, height or level: see CfVertical
  kTime,
};

/// By standard_name, units, axis and formula_terms; where all of these are missing, by customary names.
/// Source: CF conventions 1.10, chapter 4.
CfRole cfRole(const NetcdfFile& file, const NetcdfVariable& variable);

/// Kilometres of a unit of length; nothing if it is none.
std::optional<double> kilometresOf(const std::string& unit);

/// Whether its values grow downwards: by `positive`, else by what it is called.
bool growsDownwards(const NetcdfVariable& variable);

}  // namespace curvisplat
