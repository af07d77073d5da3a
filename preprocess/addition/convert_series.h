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

/// The options of the conversion of a series.
struct SeriesOptions {
  ConvertOptions convert;               // of the first step; `scalars` is not used
  bool keep_going = false;              // leave out steps that do not fit
  bool add = false;                     // to an existing cache, which has other steps
  bool to_part = false;                 // the first step is there for its geometry (series_steps.h)
  bool is_kept = false;                 // in the user's cache folder: messages name the files only
  std::function<void()> before_change;  // called before the cache changes, if it does; may throw Error
};

/// One step that was converted, or left out for `reason`.
struct SeriesEvent {
  std::string name;
  const AddStepReport* added = nullptr;      // of a further step
  const ConvertReport* converted = nullptr;  // of the first
  const GridDescription* source = nullptr;   // of the first
  std::string reason;
};

/// Facts about a converted step that takeStep() (series_steps.h) needs.
struct StepOrigin {
  bool states_time = true;
  std::vector<std::string> sources;
};

/// The results of the conversion of a series.
struct SeriesReport {
  uint64_t steps = 0;      // of the cache now
  uint64_t converted = 0;  // by this run
  uint64_t left_out = 0;
  uint64_t new_geometries = 0;      // of these steps, beside the first
  uint64_t nodes = 0;               // of a step
  std::vector<StepOrigin> origins;  // [step], those that the cache had before too; of a part of a series only
};

/// Converts a series, with options.convert.ranks by all ranks together (shared_series.h). With
/// options.convert.resume it continues an interrupted conversion of the same series: steps that the cache has
/// already, by their times, are skipped. `report` is called after each step. Throws Error that names the step
/// that does not fit, unless options.keep_going, and Interrupted; the cache keeps the
/// steps so far.
SeriesReport convertSeries(const SeriesInput& input, const SeriesOptions& options, Progress& progress,
                           const std::function<void(const SeriesEvent&)>& report);

}  // namespace curvisplat
