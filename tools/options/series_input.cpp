#include "tools/options/series_input.h"

namespace curvisplat {

std::vector<StepFiles> chosenSteps(const ConvertArguments& arguments, const std::string& option) {
  const std::vector<StepFiles> all = stepsOf(arguments.grid);
  StepSelection selection = parseSteps(option, arguments.steps.value_or("all"));
  if (arguments.every) selection.stride *= *arguments.every;
  std::vector<StepFiles> chosen;
  for (const uint64_t step : selectedSteps(option, selection, all.size())) chosen.push_back(all[step]);
  return chosen;
}

SeriesInput seriesInput(const ConvertArguments& arguments, const std::vector<StepFiles>& steps) {
  SeriesInput input;
  input.count = steps.size();
  input.name = [&](uint64_t step) { return steps[step].name; };
  input.open = [&](uint64_t step) {
    ConvertArguments of_step = arguments;
    of_step.grid = steps[step].options;
    return openSource(of_step, arguments.adds_steps ? arguments.to : arguments.output);
  };
  input.scalars = [&](const GridDescription& description) {
    return chooseScalars(arguments, arguments.scalars, description);
  };
  return input;
}

}  // namespace curvisplat
