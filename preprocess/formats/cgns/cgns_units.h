// Units of CGNS arrays in common notation: "kg m-3", from DimensionalUnits (Kilogram, Meter, ...) and the
// exponents of the array, or, if it has none, those that the standard assigns to its name.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

/// `units`: the names of the units of mass, length, time, temperature and angle. `exponents`: one for each,
/// or empty. Returns an empty text if the units or the quantity are unknown.
/// Source: CGNS Standard Interface Data Structures, sections 4.3 and annex A.
std::string cgnsUnit(const std::vector<std::string>& units, const std::vector<double>& exponents,
                     const std::string& array_name);

}  // namespace curvisplat
