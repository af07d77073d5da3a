// Which solutions and coordinates of a CGNS zone belong to a time step.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"

namespace curvisplat {

/// What a base tells of time (BaseIterativeData).
struct CgnsSteps {
  size_t count = 0;           // 0: it tells nothing
  std::vector<double> times;  // of each step: its time, else its iteration, else its number from 0
  std::vector<std::vector<std::string>> zones;  // of each step; empty: all zones are in all steps

  bool has(const std::string& zone, uint32_t step) const;
};

/// `base`: the nodes below a base. Throws Error.
CgnsSteps readCgnsSteps(const CgnsFile& file, const std::vector<CgnsNode>& base);

/// What a zone has at one step.
struct CgnsZoneStep {
  std::optional<CgnsNode> grid;     // GridCoordinates_t
  std::vector<CgnsNode> solutions;  // FlowSolution_t
  size_t implied_steps = 1;         // that the order of its solutions makes, where nothing else tells
};

/// `zone`: the nodes below a zone. A zone of one step is the same at all. Throws Error.
CgnsZoneStep readCgnsZoneStep(const CgnsFile& file, const std::vector<CgnsNode>& zone, const CgnsSteps& steps,
                              uint32_t step);

}  // namespace curvisplat
