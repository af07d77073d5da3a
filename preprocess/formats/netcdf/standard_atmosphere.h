// Height of a pressure in the standard atmosphere, for levels of pressure without a geopotential.
#pragma once

namespace curvisplat {

/// Height above mean sea level in metres; below it for more than 101,325 Pa. NaN unless `pascals` is above 0.
/// Above 71 km the temperature of its topmost layer goes on.
/// Source: hydrostatic equation in the layers of the International Standard Atmosphere (ISO 2533:1975).
double standardAltitude(double pascals);

}  // namespace curvisplat
