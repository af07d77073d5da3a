// The time steps of a series, as convertSeries() takes them, from the arguments of a conversion.
#pragma once

#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "preprocess/formats/open/series_files.h"
#include "tools/options/convert_arguments.h"

namespace curvisplat {

/// The steps that --steps and --every leave of those that the files have. `option`: the name of the former in messages. Throws
/// UsageError, and Error if the files cannot be read.
std::vector<StepFiles> chosenSteps(const ConvertArguments& arguments, const std::string& option = "--steps");

/// Opens each step as `arguments` say, and chooses the scalars of the first. Both must outlive the input.
SeriesInput seriesInput(const ConvertArguments& arguments, const std::vector<StepFiles>& steps);

}  // namespace curvisplat
