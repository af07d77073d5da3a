// The result of the first pass over a grid: number, bounds and ranges of its samples.
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

/// Counts and ranges of the nodes, or for cell-centred scalars of the cells (bounds: of their corners).
struct GridSurvey {
  uint64_t nodes = 0;  // samples (nodes or cells) of the grid, including blanked ones
  BlankCounts blanked;
  glm::dvec3 lower{std::numeric_limits<double>::infinity()};
  glm::dvec3 upper{-std::numeric_limits<double>::infinity()};
  std::vector<ScalarRange> ranges;  // [scalar]; of the samples that are not blanked
  uint64_t grid_checksum = 0;       // grid_checksum.h
};

/// Of the samples of both, which have the same scalars and no sample in common.
GridSurvey unitedSurvey(GridSurvey a, const GridSurvey& b);

}  // namespace curvisplat
