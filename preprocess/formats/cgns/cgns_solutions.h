// Reads the facts about the solutions of a CGNS zone: which solutions and coordinates belong to a time
// step, and the units of their arrays. The functions read small nodes alone. Any number of threads may call
// them; their calls into CgnsFile run one after the other.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"

namespace curvisplat {

/// The time steps of a base (BaseIterativeData).
struct CgnsSteps {
  size_t count = 0;                             // 0: the base has no BaseIterativeData
  std::vector<double> times;                    // [step]: its time, else its iteration, else its index
  std::vector<std::vector<std::string>> zones;  // [step]; empty: all zones are in all steps

  bool has(const std::string& zone, uint32_t step) const;
};

/// The time steps of a base, of which `base` are the child nodes. Throws Error.
CgnsSteps readCgnsSteps(const CgnsFile& file, const std::vector<CgnsNode>& base);

/// The grid and the solutions of a zone at one time step.
struct CgnsZoneStep {
  std::optional<CgnsNode> grid;     // GridCoordinates_t
  std::vector<CgnsNode> solutions;  // FlowSolution_t
  size_t implied_steps = 1;  // without ZoneIterativeData: by IOSS' numbers, else the order of solutions
};

/// The grid and solutions of a zone at `step`; `zone` are its child nodes. A zone with a single step is the
/// same at every step. Throws Error.
CgnsZoneStep readCgnsZoneStep(const CgnsFile& file, const std::vector<CgnsNode>& zone, const CgnsSteps& steps,
                              uint32_t step);

/// The unit of an array in common notation, "kg m-3", from DimensionalUnits and the exponents of the array
/// or, if it has none, those that the standard assigns to its name. `units` are the names of the units of
/// mass, length, time, temperature and angle (Kilogram, Meter, ...); `exponents` has one number for each, or
/// none. Returns an empty text if the units or the quantity are unknown.
/// Source: CGNS Standard Interface Data Structures, sections 4.3 and annex A.
std::string cgnsUnit(const std::vector<std::string>& units, const std::vector<double>& exponents,
                     const std::string& array_name);

}  // namespace curvisplat
