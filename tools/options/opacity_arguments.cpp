#include "tools/options/opacity_arguments.h"

#include <CLI/CLI.hpp>

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// The arguments that the opacities' function is chosen from.
ScalarArguments argumentsOfOpacities(const OpacityArguments& arguments, const ScalarArguments& scalar) {
  ScalarArguments of = arguments.by;
  of.prefix = "--opacity-";
  of.opacity = scalar.opacity;
  of.opacity_unit = scalar.opacity_unit;
  return of;
}

size_t opacityVariable(const CacheReader& cache, const OpacityArguments& arguments) {
  try {
    return cache.variableNamed(arguments.by.scalar);
  } catch (const UsageError& error) {
    throw UsageError("--opacity-by: {}", error.what());
  }
}

}  // namespace

void addOpacityOptions(CLI::App& command, OpacityArguments& arguments, const std::string& group) {
  command
      .add_option("--opacity-by", arguments.by.scalar,
                  "Name of another scalar, which gives the opacities, while --scalar gives the colours. "
                  "--opacity and --opacity-unit then apply to it")
      ->group(group);
  command
      .add_option("--opacity-range", arguments.by.range,
                  "Range of the --opacity-by scalar for --opacity, given as for --range (default: chosen "
                  "from the data)")
      ->group(group);
  command
      .add_option("--opacity-asinh", arguments.by.asinh,
                  "CENTRE,WIDTH as for --asinh, for the --opacity-by scalar")
      ->group(group);
  command
      .add_option("--opacity-tf", arguments.by.transfer_function,
                  "ParaView preset (.json) whose opacities are taken for the --opacity-by scalar")
      ->group(group);
}

void checkOpacityArguments(const OpacityArguments& arguments, const ScalarArguments& scalar) {
  if (arguments.by.scalar.empty()) {
    const std::pair<const char*, const std::optional<std::string>&> given[] = {
        {"--opacity-range", arguments.by.range},
        {"--opacity-asinh", arguments.by.asinh},
        {"--opacity-tf", arguments.by.transfer_function}};
    for (const auto& [option, value] : given)
      if (value) throw UsageError("{} {}: needs --opacity-by NAME", option, *value);
    return;
  }
  if (arguments.by.transfer_function && !arguments.by.transfer_function->ends_with(".json"))
    throw UsageError("--opacity-tf {}: expected a ParaView preset, NAME.json",
                     *arguments.by.transfer_function);
  checkFunctionArguments(argumentsOfOpacities(arguments, scalar));
}

std::string ScalarChoice::chosenOptions() const {
  const std::string& more = picture.chosenOptions();
  return chosen_colours + (chosen_colours.empty() || more.empty() ? "" : " ") + more;
}

ScalarChoice chooseScalars(const OpacityArguments& arguments, const ScalarArguments& scalar,
                           const CacheReader& cache, size_t shown, const FrameOptions& frame,
                           ChosenFor what) {
  const DefaultMaps maps = mapsOn(frame.background);
  if (arguments.by.scalar.empty()) {
    PictureChoice picture(cache, shown, frame.scale, what, maps);
    DrawnScalars scalars(shown, picture.function(scalar));
    return {std::move(scalars), std::move(picture), {}};
  }
  const size_t variable = opacityVariable(cache, arguments);
  ScalarArguments colours = scalar;
  colours.opacity.reset();
  colours.opacity_unit.reset();
  PictureChoice of_colours(cache, shown, frame.scale, what, maps);
  DrawnScalar colour{shown, of_colours.colours(colours)};
  PictureChoice picture(cache, variable, frame.scale, what, maps);
  DrawnScalar opacity{variable, picture.opacities(argumentsOfOpacities(arguments, scalar))};
  return {DrawnScalars(std::move(opacity), std::move(colour)), std::move(picture),
          of_colours.chosenOptions()};
}

}  // namespace curvisplat
