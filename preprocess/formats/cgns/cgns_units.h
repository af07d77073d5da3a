// Units of CGNS arrays as people write them: "kg m-3" of DimensionalUnits (Kilogram, Meter, ...) and the
// exponents of the array, or, where it tells none, those that the standard gives to its name.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

/// `units`: the names of mass, length, time, temperature and angle. `exponents`: of as many, or empty.
/// Empty where the units, or what the array is, are not known.
/// Source: CGNS Standard Interface Data Structures, sections 4.3 and annex A.
std::string cgnsUnit(const std::vector<std::string>& units, const std::vector<double>& exponents,
                     const std::string& array_name);

}  // namespace curvisplat
