// Finds the meaning of a coordinate variable by the CF conventions: its role (longitude, latitude, depth,
// time, or none), the length or pressure of its unit, its direction, and the height of a pressure level that
// has no geopotential. All functions look at attributes and numbers alone, read no file, and may be called by
// any thread.
#pragma once

#include <cmath>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

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

/// The role of a variable, decided by standard_name, units, axis and formula_terms; if all of these are
/// missing, by customary names.
/// Source: CF conventions 1.10, chapter 4.
CfRole cfRole(const NetcdfFiles& file, const NetcdfVariable& variable);

/// Whether a variable is along one dimension alone and has its times, whatever it is called: `time` along `t`, but not the start of
/// each forecast.
bool isTimeAlong(const NetcdfFiles& file, const NetcdfVariable& variable, size_t dim);

/// Whether a name, a unit or a meaning is one of these words.
bool isOneOf(std::string_view text, std::initializer_list<std::string_view> words);

/// Degrees in the unit of an angle: 1 unless it is the radian.
double degreesOf(const std::string& unit);

/// Whether a unit says that there is none: "", "1", "-", "none", ...
bool isUnitless(const std::string& unit);

/// The length of a unit in kilometres, also of "meters MSL", "[m]" and "1000 m"; nullopt if it is not a unit of a height: not of
/// the micrometre and what is smaller.
std::optional<double> kilometresOf(const std::string& unit);

/// A unit of pressure in pascals; nullopt if it is not a unit of pressure.
std::optional<double> pascalsOf(const std::string& unit);

/// Whether a place on the Earth has these degrees, but for rounding. Fill values that no attribute names have none.
inline bool isOnEarth(double longitude, double latitude) {
  return std::abs(latitude) <= 91 && std::abs(longitude) <= 1080;
}

/// No height is larger, in kilometres: it is a fill value.
inline constexpr double kMaxHeight = 1e10;

/// Whether names and descriptions call a vertical coordinate a height above something, or a depth below it.
bool namesHeight(const NetcdfVariable& variable);
bool namesDepth(const NetcdfVariable& variable);

/// Whether the values of a vertical coordinate increase downwards: by its attribute `positive`, else by namesDepth().
bool growsDownwards(const NetcdfVariable& variable);

/// The depth in metres at which sea water has a pressure, at 45 degrees of latitude.
/// Source: P. M. Saunders, Practical Conversion of Pressure to Depth, J. Phys. Oceanogr. 11 (1981), 573-574.
double depthOfSeaPressure(double decibar);

/// The pressure at mean sea level in the standard atmosphere, in pascals.
inline constexpr double kSeaLevelPressure = 101325;

/// The height of a pressure in the standard atmosphere, in metres above mean sea level; negative for more
/// than 101,325 Pa. NaN unless `pascals` is above 0.
/// Source: hydrostatic equation in the layers of the International Standard Atmosphere (ISO 2533:1975); above
/// 86 km, the U.S. Standard Atmosphere, 1976.
double standardAltitude(double pascals);

}  // namespace curvisplat
