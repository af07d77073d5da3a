// What the first pass over a grid finds: how much is there, between which bounds.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "preprocess/grid/node_reader.h"

namespace curvisplat {

struct ScalarRange {
  double min = std::numeric_limits<double>::infinity();
  double max = -std::numeric_limits<double>::infinity();
};

/// Of the nodes that are there; of cell-centred scalars, of the cells that are (corners, for the bounds).
struct GridSurvey {
  uint64_t nodes = 0;  // or cells; of the grid, blanked ones included
  BlankCounts blanked;
  glm::dvec3 lower{std::numeric_limits<double>::infinity()};
  glm::dvec3 upper{-std::numeric_limits<double>::infinity()};
  std::vector<ScalarRange> ranges;  // [scalar]
};

}  // namespace curvisplat
