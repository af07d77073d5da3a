// The role of a NetCDF variable by the CF conventions: longitude, latitude, depth, time, or none.
#pragma once

#include <optional>
#include <string>

#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

enum class CfRole {
  kNone,
  kLongitude,  // degrees
  kLatitude,
  kGridLongitude,  // degrees from a rotated pole
  kGridLatitude,
  kX,  // projection coordinate, a length
  kY,
  kVertical,  // depth, height or level: see CfVertical
  kTime,
};

/// Decided by standard_name, units, axis and formula_terms; if all of these are missing, by customary names.
/// Source: CF conventions 1.10, chapter 4.
CfRole cfRole(const NetcdfFiles& file, const NetcdfVariable& variable);

/// The length of a unit in kilometres; nullopt if it is not a unit of length.
std::optional<double> kilometresOf(const std::string& unit);

/// A unit of pressure in pascals; nullopt if it is not one.
std::optional<double> pascalsOf(const std::string& unit);

/// Whether its values increase downwards: by its attribute `positive`, else by its name.
bool growsDownwards(const NetcdfVariable& variable);

}  // namespace curvisplat
