#include "tools/options/picture_choice.h"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "render/annotate/globe_box.h"
#include "render/automatic/first_choice.h"
#include "render/camera/camera.h"
#include "render/camera/camera_path.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/cache/value_histogram.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {

void addScalarOption(CLI::App& command, ScalarArguments& arguments) {
  command.add_option("--scalar", arguments.scalar,
                     "Name of the scalar to draw (default: the first field that is not constant)");
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

namespace {

bool isFile(const ScalarArguments& arguments) {
  return arguments.transfer_function && arguments.transfer_function->ends_with(".json");
}

bool isAutomatic(const ScalarArguments& arguments) {
  if (isFile(arguments)) return false;
  if (arguments.opacity) return *arguments.opacity == "auto";
  return !arguments.range && !arguments.asinh && !arguments.opacity_unit;
}

/// The opacities that --opacity lists; empty if it lists none.
std::vector<OpacityPoint> opacitiesOf(const ScalarArguments& arguments) {
  if (!arguments.opacity || *arguments.opacity == "auto" || *arguments.opacity == "ramp") return {};
  return parseOpacities("--opacity", *arguments.opacity);
}

/// The name of one of the options that both scalars have.
std::string optionOf(const ScalarArguments& arguments, const char* name) {
  return std::string(arguments.prefix) + name;
}

/// Requires --asinh.
AsinhScale parseAsinh(const ScalarArguments& arguments) {
  const std::string option = optionOf(arguments, "asinh");
  const auto numbers = parseNumbers(option, *arguments.asinh, "CENTRE,WIDTH");
  if (!(numbers[1] > 0)) throw UsageError("{} {}: expected a WIDTH above zero", option, *arguments.asinh);
  return {numbers[0], numbers[1]};
}

/// The text of a number that reads back as the same number.
std::string exact(double number) {
  return fmt::format("{}", number);
}

}  // namespace

void checkFunctionArguments(const ScalarArguments& arguments) {
  opacitiesOf(arguments);
  if (arguments.asinh) parseAsinh(arguments);
  if (arguments.opacity_unit) parsePositive("--opacity-unit", *arguments.opacity_unit);
  const bool is_auto = arguments.opacity && *arguments.opacity == "auto";
  if (is_auto && isFile(arguments))
    throw UsageError("--opacity auto cannot be combined with a file: {} {} has its own opacities",
                     optionOf(arguments, "tf"), *arguments.transfer_function);
  if (is_auto && (arguments.range || arguments.asinh))
    throw UsageError("--opacity auto chooses the range as well; remove {}",
                     optionOf(arguments, arguments.range ? "range" : "asinh"));
  if (arguments.asinh && isFile(arguments))
    throw UsageError("{} cannot be combined with a file ({} {})", optionOf(arguments, "asinh"),
                     optionOf(arguments, "tf"), *arguments.transfer_function);
  if (arguments.transfer_function && !isFile(arguments)) try {
      presetDefinition(*arguments.transfer_function);
    } catch (const UsageError& error) {
      throw UsageError("--tf: {}", error.what());
    }
}

const FirstChoice& PictureChoice::data() {
  if (!data_) data_.emplace(cache_, variable_, scale_, what_);
  return *data_;
}

/// Whether an option that was filled in is one of the picture's.
bool PictureChoice::isSaid(const std::string& option) const {
  const bool of_opacities = option.starts_with("--opacity");
  const bool of_colours = option == "--tf" || option == "--scalar";
  return part_ == Part::kAll || (part_ == Part::kColours ? !of_opacities : !of_colours);
}

void PictureChoice::add(const std::string& option, const std::string& value) {
  if (!isSaid(option)) return;
  if (!chosen_.empty()) chosen_ += ' ';
  const bool has_own = part_ == Part::kOpacities && (option == "--range" || option == "--asinh");
  chosen_ += shellOption(has_own ? "--opacity" + option.substr(1) : option, value);
}

std::pair<double, double> PictureChoice::parseRange(const ScalarArguments& arguments) {
  const std::string option = optionOf(arguments, "range"), &text = *arguments.range;
  if (text == "data") return {info().min, info().max};
  for (const auto& [word, what] : {std::pair("step", ChosenFor::kStep), {"series", ChosenFor::kSeries}}) {
    const VariableInfo there = variableFor(cache_, variable_, what);
    if (text == word) return {there.min, there.max};
  }
  const size_t comma = text.find(',');
  const auto end = [&](const std::string& word) {
    if (!word.ends_with('%')) return parseNumber(option, word);
    const double percent = parseNumber(option, word.substr(0, word.size() - 1));
    if (!(percent >= 0 && percent <= 100))
      throw UsageError("{} {}: expected a percentage from 0% to 100%", option, text);
    const auto stored =
        what_ == ChosenFor::kSeries ? seriesHistogram(cache_, variable_) : stepHistogram(cache_, variable_);
    return stored && !stored->percentiles.empty() ? stored->percentile(percent / 100)
                                                  : data().percentile(percent / 100);
  };
  if (text.find('%') == std::string::npos) {
    const auto ends = parseNumbers(option, text, "LO,HI");
    if (!(ends[0] < ends[1])) throw UsageError("{} {}: expected LO,HI with LO < HI", option, text);
    return {ends[0], ends[1]};
  }
  if (comma == std::string::npos || text.find(',', comma + 1) != std::string::npos)
    throw UsageError("{} {}: expected two ends, such as 1%,99%", option, text);
  const std::pair range(end(text.substr(0, comma)), end(text.substr(comma + 1)));
  if (!(range.first < range.second))
    throw UsageError("{} {}: {} has {} at both percentiles or the ends are reversed; give numbers", option,
                     text, info().name, range.first);
  return range;
}

TransferFunction PictureChoice::function(const ScalarArguments& arguments) {
  checkFunctionArguments(arguments);
  if (arguments.scalar.empty() && cache_.manifest().variables.size() > 1) add("--scalar", info().name);
  if (arguments.film) return TransferFunction(*arguments.film, nullptr, arguments.film->opacity_unit);
  if (isFile(arguments)) return fromFile(arguments);
  if (isAutomatic(arguments)) return automatic(arguments);
  FunctionParts parts;
  parts.map = maps_.sequential;
  if (arguments.transfer_function) parts.map = *arguments.transfer_function;
  parts.range = arguments.range ? parseRange(arguments) : std::pair(info().min, info().max);
  if (arguments.asinh) parts.asinh = parseAsinh(arguments);
  parts.opacities = opacitiesOf(arguments);
  return fromParts(std::move(parts), arguments);
}

TransferFunction PictureChoice::colours(const ScalarArguments& arguments) {
  part_ = Part::kColours;
  return function(arguments);
}

TransferFunction PictureChoice::opacities(const ScalarArguments& arguments) {
  part_ = Part::kOpacities;
  return function(arguments);
}

TransferFunction PictureChoice::withUnit(const TransferFunctionDefinition& definition,
                                         const std::pair<double, double>* range,
                                         const ScalarArguments& arguments) {
  if (arguments.opacity_unit)
    return TransferFunction(definition, range, parsePositive("--opacity-unit", *arguments.opacity_unit));
  if (definition.opacity_unit > 0) return TransferFunction(definition, range, definition.opacity_unit);
  const double unit = data().opacityUnitOf(TransferFunction(definition, range, 1));
  add("--opacity-unit", exact(unit));
  return TransferFunction(definition, range, unit);
}

TransferFunction PictureChoice::fromFile(const ScalarArguments& arguments) {
  TransferFunctionDefinition definition = readParaViewPreset(*arguments.transfer_function);
  std::optional<std::pair<double, double>> range;
  if (arguments.range) range = parseRange(arguments);
  if (const auto opacities = opacitiesOf(arguments); !opacities.empty()) {
    // Opacities are along the range, which is the file's own if none is given.
    if (!range) range = TransferFunction(definition, nullptr, 1).range();
    definition.opacities = opacities;
  } else if (arguments.opacity) {
    definition.opacities.clear();  // ramp
  }
  return withUnit(definition, range ? &*range : nullptr, arguments);
}

TransferFunction PictureChoice::fromParts(FunctionParts parts, const ScalarArguments& arguments) {
  const bool constant = !(parts.range.first < parts.range.second);
  parts.range = intervalAround(parts.range.first, parts.range.second);
  TransferFunctionDefinition definition = parts.definition();
  if (constant)
    definition.notes.push_back(fmt::format(
        "the scalar is {} everywhere; it is drawn in the middle of the preset '{}'", info().min, parts.map));
  return withUnit(definition, nullptr, arguments);
}

namespace {

/// Names what to choose where a scalar is constant: a scalar that is not, or a time step.
std::string adviceOnConstant(const CacheReader& cache, ChosenFor what) {
  const std::vector<VariableInfo>& variables = cache.manifest().variables;
  for (size_t n = 0; n < variables.size(); ++n)
    if (!isNearlyConstant(variableFor(cache, n, what))) return "; choose another --scalar";
  for (const VariableInfo& variable : variables)
    if (!isNearlyConstant(variable))
      return fmt::format("; choose another --scalar, or another --step ({} varies in one)", variable.name);
  return "";
}

}  // namespace

TransferFunction PictureChoice::automatic(const ScalarArguments& arguments) {
  FunctionParts parts =
      data().function(arguments.transfer_function.value_or(""), maps_, arguments.with_sheets);
  TransferFunctionDefinition definition = parts.definition();
  if (isNearlyConstant(info()))
    definition.notes.push_back(fmt::format("{} is {} everywhere, or nearly so{}", info().name,
                                           numberText(info().min + 0.0),  // not -0
                                           adviceOnConstant(cache_, what_)));
  if (!arguments.transfer_function) add("--tf", parts.map);
  add("--range", exact(parts.range.first) + "," + exact(parts.range.second));
  if (parts.asinh) add("--asinh", exact(parts.asinh->centre) + "," + exact(parts.asinh->width));
  add("--opacity", textOf(parts.opacities));
  if (!arguments.opacity_unit) add("--opacity-unit", exact(parts.opacity_unit));
  definition.opacity_unit = parts.opacity_unit;
  return withUnit(definition, nullptr, arguments);
}

namespace {

/// The place behind that of the camera from which the box is seen whole once around, so that a part of an orbit has the pictures of
/// the whole one.
glm::dvec3 placeForOrbit(const Camera& camera, const PictureChoice::Framing& framing) {
  double distance = 0;
  for (unsigned n = 0; n < kDefaultFrames; ++n) {
    Camera turned = orbited(camera, 360.0 * n / kDefaultFrames);
    turned.fit(framing.box.lower, framing.box.upper, framing.size);
    distance = std::max(distance, glm::distance(turned.position, turned.focal_point));
  }
  return camera.focal_point + distance * glm::normalize(camera.position - camera.focal_point);
}

}  // namespace

CameraArguments PictureChoice::camera(CameraArguments arguments, const TransferFunction& function,
                                      const Framing& framing) {
  if (!arguments.place()) place(arguments, function, framing);
  if (const auto scale = fittingScale(arguments, framing.box, framing.size)) {
    arguments.parallel_scale = exact(*scale);
    add("--parallel-scale", *arguments.parallel_scale);
  }
  return arguments;
}

void PictureChoice::place(CameraArguments& arguments, const TransferFunction& function,
                          const Framing& framing) {
  const auto& [box, size, whole, above] = framing;
  const auto exactPoint = [](const glm::dvec3& point) {
    return fmt::format("{},{},{}", point.x, point.y, point.z);
  };
  const auto say = [&](const char* option, std::optional<std::string>& argument, const std::string& value) {
    argument = value;
    add(option, value);
  };
  if (above) {
    const Camera camera = cameraAbove(*above, scale_, size);
    say("--position", arguments.position, exactPoint(camera.position));
    say("--view-up", arguments.view_up, exactPoint(camera.view_up));
    say("--focal-point", arguments.focal_point, exactPoint(camera.focal_point));
    say("--view-angle", arguments.view_angle, exact(camera.view_angle_deg));
    return;
  }
  const bool orbits = arguments.orbit.has_value();
  const ViewChoice choice =
      data().view(function, size, whole || orbits ? Framed::kBox : Framed::kSeen, box.lower, box.upper);
  // Around a side of thin data, it would be seen edge-on.
  if (orbits && !choice.position) return say("--view", arguments.view, "iso");
  Camera camera = cameraOf(choice, box.lower, box.upper, size);
  if (orbits) camera.position = placeForOrbit(camera, framing);
  say("--position", arguments.position, exactPoint(camera.position));
  if (camera.view_up != glm::dvec3(0, 0, 1)) say("--view-up", arguments.view_up, exactPoint(camera.view_up));
  if (choice.focal_point) say("--focal-point", arguments.focal_point, exactPoint(*choice.focal_point));
  if (choice.position)
    say("--view-angle", arguments.view_angle, exact(kChosenViewAngle));
  else if (choice.focal_point)
    say("--parallel-scale", arguments.parallel_scale, exact(choice.parallel_scale));
}

}  // namespace curvisplat
