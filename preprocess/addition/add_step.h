// Adds a time step to a cache, and defines the input of a series of steps (SeriesInput) for convert_series.h
// and join_series.h. If the step's coordinates and blanking are those of an earlier step, only its
// values are added, which takes half a conversion's time; otherwise it is converted to a geometry of its
// own. One thread calls; memory is bounded by the options.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/calendar.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// The options of an addition of a time step.
struct AddStepOptions {
  std::filesystem::path cache;
  std::optional<double> time;              // otherwise the source's, or one more than the last step's
  std::optional<double> blank_value;       // as the other steps were converted with
  uint64_t memory_bytes = 0;               // 0: defaultMemory()
  unsigned threads = 0;                    // 0: as many as the machine has
  bool check_disk_space = true;            // before the work
  bool resume = false;                     // continue an interrupted conversion of this step, if there is one
  bool expect_new_geometry = false;        // for speed only: the previous step had a new geometry
  bool to_part = false;                    // the cache is a part of a series (series_steps.h)
  std::filesystem::path temporary_folder;  // empty: the folder of the cache
  std::vector<std::filesystem::path> given_folders;  // for messages: the user's, if those above are temporary

  TestLimits limits;
};

/// The results of an addition of a time step.
struct AddStepReport {
  uint64_t step = 0;  // its number
  double time = 0;
  bool new_geometry = false;
  uint64_t nodes = 0;
  std::vector<FileReport> files;  // the new ones
  std::vector<std::string> warnings;
};

/// The description's statedTime(), converted to the unit of the series where both have one: each file of a
/// model may count from a date of its own. Throws Error if it cannot be converted to that unit.
std::optional<double> timeOf(const GridDescription& description, const TimeUnit& of_series);

/// Adds the step. The cache's scalars are found in the source by name. Throws Error if the step does not fit:
/// other blocks, a missing scalar, a time that is not after the last; or if a file, the disk or memory fails.
/// After an exception the cache is as it was; after a kill at any moment it has the steps before. The peak
/// memory of the process, everything included, is options.memory_bytes.
///
/// The step is added to each set of scalars with blanks of its own (Manifest::own_blanks), too, before it is added to the cache.
/// A set that the step lacks, or that has a value at none of its samples, ends with the step before: a warning says so, and later
/// steps are not added to it.
AddStepReport addStep(const DataSource& source, const AddStepOptions& options, Progress& progress);

/// The steps of a series, in the order in which they are converted.
struct SeriesInput {
  uint64_t count = 0;
  /// Names a step for messages: "q.0100" or "run.nc, time step 3".
  std::function<std::string(uint64_t)> name;
  /// Opens a step's files. Throws Error.
  std::function<std::unique_ptr<DataSource>(uint64_t)> open;
  /// Positions of the scalars to convert, for the first step. Throws Error.
  std::function<std::vector<uint32_t>(const GridDescription&)> scalars;
  /// [step] its number in the whole series, of which this is a part (series_steps.h). Empty: this is the
  /// whole series.
  std::vector<uint64_t> places;
};

}  // namespace curvisplat
