#include "tools/options/scalar_arguments.h"

#include <string>
#include <vector>

#include "render/automatic/first_choice.h"
#include "stream/base/error.h"

namespace curvisplat {

void addScalarOption(CLI::App& command, ScalarArguments& arguments) {
  command.add_option("--scalar", arguments.scalar,
                     "Name of the scalar to draw (default: the first that is not constant)");
}

void addFunctionOptions(CLI::App& command, ScalarArguments& arguments, const std::string& group) {
  command
      .add_option(
          "--tf", arguments.transfer_function,
          "Colour map, such as viridis, thermal or cool-warm (curvisplat colormaps lists them; NAME_r is "
          "reversed), or the path of a ParaView preset (.json) (default: chosen from the data)")
      ->group(group);
  command
      .add_option("--range", arguments.range,
                  "Scalar range of the transfer function: LO,HI; percentiles of the volume, such as 1%,99%; "
                  "or all values of step (the first time step drawn), series (all time steps) or data "
                  "(series with --steps, otherwise step) "
                  "(default: chosen from the data, or the range in the --tf file)")
      ->group(group);
  command
      .add_option("--opacity", arguments.opacity,
                  "Opacities along the range, POSITION:OPACITY,... from 0 to 1, such as "
                  "0.2:0,0.5:0.8,1:0.1; ramp, which rises from 0 to 0.4; or auto, chosen from the data "
                  "(default: auto; ramp if --range or --opacity-unit is given)")
      ->group(group);
  command
      .add_option("--asinh", arguments.asinh,
                  "Spread values near CENTRE: colours and opacities follow asinh((value - CENTRE)/WIDTH) "
                  "along the range. CENTRE,WIDTH (default: chosen from the data; none if --range is given)")
      ->group(group);
  command
      .add_option("--opacity-unit", arguments.opacity_unit,
                  "Opacity unit: length in world units over which the function's opacity accumulates. "
                  "Smaller is more opaque (default: chosen so that the data absorbs 65 % of the light)")
      ->group(group);
}

std::string givenFunctionOptions(const ScalarArguments& arguments) {
  std::vector<std::string> given;
  if (arguments.transfer_function) given.emplace_back("--tf");
  if (arguments.range) given.emplace_back("--range");
  if (arguments.opacity) given.emplace_back("--opacity");
  if (arguments.asinh) given.emplace_back("--asinh");
  if (arguments.opacity_unit) given.emplace_back("--opacity-unit");
  std::string text;
  for (size_t n = 0; n < given.size(); ++n)
    text += (n == 0 ? "" : n + 1 == given.size() ? " and " : ", ") + given[n];
  return text;
}

size_t chooseVariable(const CacheReader& cache, const ScalarArguments& arguments) {
  if (arguments.scalar.empty() && !cache.manifest().variables.empty())
    return firstVaryingVariable(cache.manifest());
  try {
    return cache.variableNamed(arguments.scalar);
  } catch (const UsageError& error) {
    if (arguments.scalar == "all" || arguments.scalar.find(',') != std::string::npos)
      throw Error(
          "--scalar {}: a picture shows one scalar; draw each by a command of its own, or take the opacities "
          "of a "
          "second with --opacity-by",
          arguments.scalar);
    throw Error("{}", error.what());
  }
}

}  // namespace curvisplat
