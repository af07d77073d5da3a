// The steps of a series, as they are converted one after the other.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The steps of a series, in order.
struct SeriesInput {
  uint64_t count = 0;
  /// Names a step for messages: "q.0100" or "run.nc, time step 3".
  std::function<std::string(uint64_t)> name;
  /// Throws Error.
  std::function<std::unique_ptr<DataSource>(uint64_t)> open;
  /// Positions of the scalars to convert, for the first step. Throws Error.
  std::function<std::vector<uint32_t>(const GridDescription&)> scalars;
  /// [step] where it stands in the whole series, of which this is a part (series_part.h). Empty: these are all.
  std::vector<uint64_t> places;
};

}  // namespace curvisplat
