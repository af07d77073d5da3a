// Which solutions and coordinates of a CGNS zone belong to a time step.
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

/// `base`: the child nodes of a base. Throws Error.
CgnsSteps readCgnsSteps(const CgnsFile& file, const std::vector<CgnsNode>& base);

/// The grid and the solutions of a zone at one time step.
struct CgnsZoneStep {
  std::optional<CgnsNode> grid;     // GridCoordinates_t
  std::vector<CgnsNode> solutions;  // FlowSolution_t
  size_t implied_steps = 1;  // without ZoneIterativeData: by IOSS' numbers, else the order of solutions
};

/// `zone`: the child nodes of a zone. A zone with a single step is the same at every step. Throws Error.
CgnsZoneStep readCgnsZoneStep(const CgnsFile& file, const std::vector<CgnsNode>& zone, const CgnsSteps& steps,
                              uint32_t step);

}  // namespace curvisplat
