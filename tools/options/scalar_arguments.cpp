#include "tools/options/scalar_arguments.h"

#include <fmt/format.h>

#include <utility>

#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {

void addScalarOption(CLI::App& command, ScalarArguments& arguments) {
  command.add_option("--scalar", arguments.scalar, "Name of the scalar to draw (default: the cache's first)");
}

void addFunctionOptions(CLI::App& command, ScalarArguments& arguments, const std::string& group) {
  command
      .add_option(
          "--tf", arguments.transfer_function,
          fmt::format("Transfer function: {}, or the path of a ParaView preset (.json)", presetNames()))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--range", arguments.range,
                  "Scalar range LO,HI of the transfer function (default: the scalar's range; with a file, "
                  "the file's range)")
      ->group(group);
  command
      .add_option("--opacity-unit", arguments.opacity_unit,
                  "Opacity unit: length in world units over which the function's opacity accumulates. "
                  "Smaller is more "
                  "opaque (default: 1/100 of the data's diagonal)")
      ->group(group);
}

size_t chooseVariable(const CacheReader& cache, const ScalarArguments& arguments) {
  try {
    return cache.variableNamed(arguments.scalar);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());
  }
}

TransferFunction chooseTransferFunction(const ScalarArguments& arguments, const VariableInfo& variable,
                                        double diagonal) {
  const double default_unit = diagonal > 0 ? diagonal / 100 : 1;
  const double unit = arguments.opacity_unit ? parsePositive("--opacity-unit", *arguments.opacity_unit) : 0;
  std::optional<std::pair<double, double>> range;
  if (arguments.range) {
    const auto ends = parseNumbers("--range", *arguments.range, "LO,HI");
    if (!(ends[0] < ends[1])) throw UsageError("--range {}: expected LO,HI with LO < HI", *arguments.range);
    range.emplace(ends[0], ends[1]);
  }
  if (arguments.transfer_function.ends_with(".json"))
    return TransferFunction::fromFile(arguments.transfer_function, range ? &*range : nullptr, unit,
                                      default_unit);
  return TransferFunction::preset(arguments.transfer_function, range ? range->first : variable.min,
                                  range ? range->second : variable.max, unit > 0 ? unit : default_unit);
}

}  // namespace curvisplat
