// Converts a series of time steps to one cache: converts the first step, then adds each further one
// (add_step.h). From the first step on, the cache is complete at every moment and has the steps so far.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/addition/add_step.h"
#include "preprocess/convert/convert.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// The steps of a series, in order.
struct SeriesInput {
  uint64_t count = 0;
  uint64_t first_number = 0;  // of the first step, in messages
  /// Names a step for messages: "q.0100" or "run.nc, time step 3".
  std::function<std::string(uint64_t)> name;
  /// Throws Error.
  std::function<std::unique_ptr<DataSource>(uint64_t)> open;
  /// Positions of the scalars to convert, for the first step. Throws Error.
  std::function<std::vector<uint32_t>(const GridDescription&)> scalars;
};

struct SeriesOptions {
  ConvertOptions convert;   // of the first step; `scalars` is not used
  bool keep_going = false;  // leave out steps that do not fit
  bool add = false;         // to an existing cache, which has other steps
};

/// One step that was converted, or left out for `reason`.
struct SeriesEvent {
  std::string name;
  const AddStepReport* added = nullptr;      // of a further step
  const ConvertReport* converted = nullptr;  // of the first
  const GridDescription* source = nullptr;   // of the first
  std::string reason;
};

struct SeriesReport {
  uint64_t steps = 0;      // of the cache now
  uint64_t converted = 0;  // by this run
  uint64_t left_out = 0;
  uint64_t new_geometries = 0;  // of these steps, beside the first
  uint64_t nodes = 0;           // of a step
};

/// Converts a series. With options.convert.resume it continues an interrupted conversion of the same series:
/// steps that the cache has already, by their times, are skipped. `report` is called after each step. Throws
/// Error that names the step that does not fit, unless options.keep_going, and Interrupted; the cache keeps the
/// steps so far.
SeriesReport convertSeries(const SeriesInput& input, const SeriesOptions& options, Progress& progress,
                           const std::function<void(const SeriesEvent&)>& report);

}  // namespace curvisplat
