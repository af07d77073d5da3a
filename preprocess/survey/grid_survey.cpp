#include "preprocess/survey/grid_survey.h"

#include <algorithm>
#include <cstddef>
#include <glm/common.hpp>

namespace curvisplat {

GridSurvey unitedSurvey(GridSurvey a, const GridSurvey& b) {
  a.nodes += b.nodes;
  a.blanked += b.blanked;
  a.grid_checksum += b.grid_checksum;
  a.lower = glm::min(a.lower, b.lower);
  a.upper = glm::max(a.upper, b.upper);
  for (size_t scalar = 0; scalar < a.ranges.size(); ++scalar) {
    a.ranges[scalar].min = std::min(a.ranges[scalar].min, b.ranges[scalar].min);
    a.ranges[scalar].max = std::max(a.ranges[scalar].max, b.ranges[scalar].max);
  }
  return a;
}

}  // namespace curvisplat
