#include "tools/options/step_arguments.h"

#include "preprocess/formats/open/series_files.h"
#include "stream/base/error.h"
#include "stream/base/message.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {

namespace {

/// That a time lies outside of the series: perhaps it is in another unit.
void noteTimeOutside(const std::string& time, const Series& series, const StepPosition& position) {
  const double number = parseNumber("--time", time), first = series.steps.front().time,
               last = series.steps.back().time;
  if (number < first || number > last)
    printMessage("note: --time {}: the series has times from {:g} to {:g}; step {} is taken", time, first,
                 last, position.step);
}

}  // namespace

void addStepOptions(CLI::App& command, StepArguments& arguments, const std::string& group) {
  CLI::Option* const step =
      command.add_option("--step", arguments.step, "Time step of the cache, counted from 0 (default 0)")
          ->group(group);
  command.add_option("--time", arguments.time, "Choose the time step nearest to this time")
      ->group(group)
      ->excludes(step);
}

void addStepsOption(CLI::App& command, StepArguments& arguments, const std::string& group) {
  command
      .add_option("--steps", arguments.steps,
                  "Draw a frame of each time step: all, FIRST:LAST or FIRST:LAST:STRIDE, counted from 0")
      ->group(group);
}

void addInterpolateOption(CLI::App& command, StepArguments& arguments, const std::string& group) {
  command
      .add_flag(
          "--interpolate", arguments.interpolates,
          "Draw times between two steps of one grid by linear interpolation of their values, instead of "
          "the nearest step")
      ->group(group);
}

std::vector<StepPosition> chosenSteps(const StepArguments& arguments, const CacheReader& cache) {
  if (arguments.steps && (arguments.step || arguments.time))
    throw UsageError("--steps cannot be combined with --step or --time, which choose one");
  const Series& series = cache.series();
  if (arguments.steps) {
    std::vector<StepPosition> positions;
    for (const uint64_t step :
         selectedSteps("--steps", parseSteps("--steps", *arguments.steps), series.steps.size()))
      positions.push_back({step});
    return positions;
  }
  if (arguments.time) {
    const double time = parseNumber("--time", *arguments.time);
    return {arguments.interpolates ? series.between(time) : StepPosition{series.nearest(time)}};
  }
  const uint64_t step = arguments.step.value_or(0);
  if (step >= series.steps.size())
    throw UsageError(
        "--step {}: is out of range; {} has {}", step, cache.cachePath().string(),
        series.steps.size() == 1 ? "one time step" : fmt::format("steps 0 to {}", series.steps.size() - 1));
  return {{step}};
}

CacheReader openAtStep(const std::filesystem::path& path, const StepArguments& arguments) {
  CacheReader cache(path);
  const StepPosition position = chosenSteps(arguments, cache).front();
  if (arguments.time) noteTimeOutside(*arguments.time, cache.series(), position);
  return position == cache.position() ? std::move(cache) : cache.at(position);
}

}  // namespace curvisplat
