#include "tools/options/step_arguments.h"

#include "preprocess/formats/open/series_files.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {

void addStepOptions(CLI::App& command, StepArguments& arguments, const std::string& group) {
  CLI::Option* const step =
      command.add_option("--step", arguments.step, "Time step, counted from 0 (default 0)")->group(group);
  command.add_option("--time", arguments.time, "Time of the step; the nearest step is taken")
      ->group(group)
      ->excludes(step);
}

void addStepsOption(CLI::App& command, StepArguments& arguments, const std::string& group) {
  command
      .add_option("--steps", arguments.steps,
                  "Draw a frame of each time step: all, FIRST:LAST or FIRST:LAST:STRIDE, counted from 0")
      ->group(group);
}

std::vector<uint64_t> chosenSteps(const StepArguments& arguments, const CacheReader& cache) {
  if (arguments.steps && (arguments.step || arguments.time))
    throw UsageError("--steps cannot be combined with --step or --time, which choose one");
  const Series& series = cache.series();
  if (arguments.steps)
    return selectedSteps("--steps", parseSteps("--steps", *arguments.steps), series.steps.size());
  if (arguments.time) return {series.nearest(parseNumber("--time", *arguments.time))};
  const uint64_t step = arguments.step.value_or(0);
  if (step >= series.steps.size())
    throw UsageError(
        "--step {}: is out of range; {} has {}", step, cache.cachePath().string(),
        series.steps.size() == 1 ? "one time step" : fmt::format("steps 0 to {}", series.steps.size() - 1));
  return {step};
}

CacheReader openAtStep(const std::filesystem::path& path, const StepArguments& arguments) {
  CacheReader cache(path);
  const uint64_t step = chosenSteps(arguments, cache).front();
  return step == cache.step() ? std::move(cache) : cache.atStep(step);
}

}  // namespace curvisplat
