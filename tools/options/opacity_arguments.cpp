#include "tools/options/opacity_arguments.h"

#include <CLI/CLI.hpp>

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// The scalar of the opacities; empty where there is one scalar.
const std::string& nameOf(const OpacityArguments& arguments) {
  return arguments.by.scalar.empty() ? arguments.iso_scalar : arguments.by.scalar;
}

/// The arguments that the opacities' function is chosen from.
ScalarArguments opacitiesOf(const OpacityArguments& arguments, const ScalarArguments& scalar) {
  ScalarArguments of = arguments.by;
  of.prefix = "--opacity-";
  of.scalar = nameOf(arguments);
  of.opacity = scalar.opacity;
  of.opacity_unit = scalar.opacity_unit;
  return of;
}

size_t variableOf(const CacheReader& cache, const OpacityArguments& arguments) {
  try {
    return cache.variableNamed(nameOf(arguments));
  } catch (const UsageError& error) {
    throw Error("{}: {}", arguments.by.scalar.empty() ? "--iso-by" : "--opacity-by", error.what());
  }
}

}  // namespace

void addOpacityOptions(CLI::App& command, OpacityArguments& arguments, const std::string& group,
                       const std::string& surfaces_group) {
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
  command
      .add_option("--iso-by", arguments.iso_scalar,
                  "Scalar whose isosurfaces --iso draws, coloured by --scalar. With --opacity-by it must be "
                  "one of these two (default: the --opacity-by scalar if given, otherwise --scalar)")
      ->group(surfaces_group);
}

bool isoOfColours(const OpacityArguments& arguments, const ScalarArguments& scalar) {
  return !arguments.by.scalar.empty() && !arguments.iso_scalar.empty() &&
         arguments.iso_scalar != arguments.by.scalar && arguments.iso_scalar == scalar.scalar;
}

void checkOpacityArguments(const OpacityArguments& arguments, const ScalarArguments& scalar,
                           const SurfaceArguments& surfaces) {
  if (!arguments.iso_scalar.empty()) {
    if (surfaces.isovalues.empty())
      throw UsageError("--iso-by {}: needs an isosurface: --iso VALUE", arguments.iso_scalar);
    if (!arguments.by.scalar.empty() && arguments.by.scalar != arguments.iso_scalar &&
        !isoOfColours(arguments, scalar))
      throw UsageError(
          "--iso-by {}: a picture has two scalars, and the isosurfaces are those of --opacity-by {} or of "
          "--scalar; "
          "add --scalar {}, or leave one of the two out",
          arguments.iso_scalar, arguments.by.scalar, arguments.iso_scalar);
    if (arguments.by.scalar.empty() && surfaces.volume == "on")
      throw UsageError(
          "--iso-by {}: with the volume, its opacities are that scalar's: add --opacity-by {}, "
          "or --volume off",
          arguments.iso_scalar, arguments.iso_scalar);
  }
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
  checkFunctionArguments(opacitiesOf(arguments, scalar));
}

std::string ScalarChoice::chosenOptions() const {
  const std::string& more = picture.chosenOptions();
  return chosen_colours + (chosen_colours.empty() || more.empty() ? "" : " ") + more;
}

ScalarChoice chooseScalars(const OpacityArguments& arguments, const ScalarArguments& scalar,
                           const CacheReader& cache, size_t shown, const FrameOptions& frame,
                           ChosenFor what) {
  const DefaultMaps maps = mapsOn(frame.background);
  if (nameOf(arguments).empty()) {
    PictureChoice picture(cache, shown, frame.scale, what, maps);
    DrawnScalars scalars(shown, picture.function(scalar));
    return {std::move(scalars), std::move(picture), {}};
  }
  const size_t variable = variableOf(cache, arguments);
  ScalarArguments colours = scalar;
  colours.opacity.reset();
  colours.opacity_unit.reset();
  PictureChoice of_colours(cache, shown, frame.scale, what, maps);
  DrawnScalar colour{shown, of_colours.colours(colours)};
  PictureChoice picture(cache, variable, frame.scale, what, maps);
  DrawnScalar opacity{variable, picture.opacities(opacitiesOf(arguments, scalar))};
  return {DrawnScalars(std::move(opacity), std::move(colour)), std::move(picture),
          of_colours.chosenOptions()};
}

}  // namespace curvisplat
