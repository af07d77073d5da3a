#include "tools/options/series_input.h"

#include "preprocess/formats/open/open_grid.h"

namespace curvisplat {

SeriesInput seriesInput(const ConvertArguments& arguments, const std::vector<StepFiles>& steps) {
  SeriesInput input;
  input.count = steps.size();
  input.name = [&](uint64_t step) { return steps[step].name; };
  input.open = [&](uint64_t step) {
    ConvertArguments of_step = arguments;
    of_step.grid = steps[step].options;
    return requireGrid(openSource(of_step, arguments.adds_steps ? arguments.to : arguments.output),
                       "cannot be a time series in one cache; convert each step to its own (--time-step)");
  };
  input.scalars = [&](const GridDescription& description) {
    return chooseScalars(arguments, arguments.scalars, description);
  };
  return input;
}

}  // namespace curvisplat
