#include "tools/options/annotation_arguments.h"

#include <fmt/format.h>

#include <algorithm>

#include "render/annotate/globe_box.h"
#include "render/surface/scene_layers.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

MarkerSign parseMarker(const std::string& text) {
  const size_t end = std::min(text.find(':'), text.size());
  return {parsePoint("--marker", text.substr(0, end)), text.substr(std::min(end + 1, text.size()))};
}

}  // namespace

void addAnnotationOptions(CLI::App& command, AnnotationArguments& arguments, const std::string& group) {
  CLI::Option* const bar =
      command
          .add_flag(
              "--scalar-bar", arguments.shown.scalar_bar,
              "Draw scalar bars beside the data, one for each function that is shown (default: in a .png, "
              "movie or page of 300x300 or more whose function is chosen from the data)")
          ->group(group);
  command.add_flag("--no-scalar-bar", arguments.no_bars, "Draw no scalar bars where nothing asks for them")
      ->group(group)
      ->excludes(bar);
  command
      .add_option("--scalar-bar-title", arguments.bar_titles,
                  "Title of the scalar bar (default: name and unit of the scalar); repeatable, for the bars "
                  "from left to right; implies --scalar-bar")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command.add_flag("--axes", arguments.shown.axes, "Draw the directions of x, y and z")->group(group);
  command
      .add_flag("--axes-grid", arguments.shown.axes_grid,
                "Draw a grid behind the data, with coordinates (before --scale) along its edges; of data on "
                "a globe "
                "longitude, latitude and depth or height")
      ->group(group);
  command
      .add_option(
          "--axes-titles", arguments.axis_titles,
          "Titles of the axes grid, X,Y,Z, such as \"x [m],y [m],depth [m]\" (default x,y,z); implies "
          "--axes-grid")
      ->group(group);
  command.add_flag("--outline", arguments.shown.outline, "Draw the bounding box of the data")->group(group);
  command
      .add_option("--marker", arguments.markers,
                  "Mark a point of the data (before --scale), with a text: X,Y,Z:TEXT or X,Y,Z; repeatable")
      ->take_all()
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option(
          "--title", arguments.title,
          "Title above the data; {time}, {step}, {frame}, {scalar} and {units} stand for what is shown")
      ->group(group);
  command
      .add_option("--label", arguments.label,
                  "Text in the upper left corner, with the same fields: \"t = {time:.2f} s\", \"{scalar}\"")
      ->group(group);
  command
      .add_option("--text-size", arguments.text_size,
                  "Size of the font of all these, in pixels (default: 1/42 of the picture's height, at most "
                  "2/63 of its width)")
      ->group(group);
}

void checkAnnotationArguments(const AnnotationArguments& arguments) {
  if (arguments.no_bars && !arguments.bar_titles.empty())
    throw UsageError("--scalar-bar-title {}: there is no bar with --no-scalar-bar; remove one of them",
                     arguments.bar_titles.front());
  axisTitles(arguments);
  AnnotatedScene scene;
  arguments.fill({}, scene);
}

void AnnotationArguments::showTitles() {
  constexpr double kMin = 4, kMax = 1000;
  shown.scalar_bar |= !bar_titles.empty();
  shown.axes_grid |= axis_titles.has_value();
  shown.texts = title || label;
  shown.markers = !markers.empty();
  if (!text_size) return;
  shown.text_size = parsePositive("--text-size", *text_size);
  if (!(shown.text_size >= kMin && shown.text_size <= kMax))
    throw UsageError("--text-size {}: expected pixels from {:g} to {:g}", *text_size, kMin, kMax);
}

void AnnotationArguments::fill(const TextFields& fields, AnnotatedScene& scene) const {
  scene.text_size = shown.text_size;
  if (title) scene.title = filledText("--title", *title, fields);
  if (label) scene.label = filledText("--label", *label, fields);
  for (const std::string& marker : markers) scene.markers.push_back(parseMarker(marker));
}

void AnnotationArguments::put(const std::optional<AnnotatedScene::OnGlobe>& box,
                              AnnotatedScene& scene) const {
  const std::array<std::string, 3> given = scene.axis_titles;
  showOnGlobe(box, scene);
  if (axis_titles) scene.axis_titles = given;
}

std::array<std::string, 3> axisTitles(const AnnotationArguments& arguments) {
  std::array<std::string, 3> titles{"x", "y", "z"};
  if (!arguments.axis_titles) return titles;
  const std::string& text = *arguments.axis_titles;
  if (std::count(text.begin(), text.end(), ',') != 2)
    throw UsageError("--axes-titles {}: expected three titles, X,Y,Z", text);
  size_t begin = 0;
  for (std::string& title : titles) {
    const size_t end = std::min(text.find(',', begin), text.size());
    title = text.substr(begin, end - begin);
    begin = end + 1;
  }
  return titles;
}

ShownBox shownBox(const Manifest& manifest, const glm::dvec3& scale, const std::optional<WorldBox>& clip_box,
                  const Annotations& annotations) {
  constexpr double kAxesRoom = 0.17;  // of the box
  const bool whole = annotations.outline || annotations.axes_grid;
  WorldBox box = leftBy(whole ? std::nullopt : clip_box, {manifest.lower, manifest.upper});
  box.lower *= scale;
  box.upper *= scale;
  const glm::dvec3 room = (annotations.axes_grid ? kAxesRoom : 0.0) * (box.upper - box.lower);
  return {box.lower - room, box.upper + room};
}

std::vector<ShownFunction> shownFunctions(const AnnotationArguments& arguments, const DrawnScalars& scalars,
                                          const Manifest& manifest, const SurfaceScene* scene,
                                          const std::string& surface_by) {
  std::vector<ShownFunction> shown;
  const DrawnScalar& coloured = scalars.colour ? *scalars.colour : scalars.opacity;
  const auto titleOf = [&](size_t variable) {
    const VariableInfo& info = manifest.variables[variable];
    return scalarTitle(info.name, info.unit);
  };
  const bool volume = !scene || scene->volume;
  using Part = ShownFunction::Part;
  if (!scene || usesColours(*scene))
    shown.push_back({&coloured.function, titleOf(coloured.variable),
                     scalars.colour || !volume ? Part::kColours : Part::kBoth});
  if (scalars.colour && volume)
    shown.push_back(
        {&scalars.opacity.function, titleOf(scalars.opacity.variable) + " (opacity)", Part::kOpacities});
  if (scene)
    for (const GridSurface& surface : scene->grid_surfaces) {
      if (!surface.function) continue;
      const VariableInfo* const info = manifest.variable(surface_by);
      shown.push_back({surface.function.get(), info ? scalarTitle(info->name, info->unit) : surface_by});
      break;
    }
  if (scene && !scene->curves.empty() && scene->curves.front().function)
    shown.push_back({scene->curves.front().function.get(), scene->curves.front().title});
  if (arguments.bar_titles.size() > shown.size())
    throw UsageError("--scalar-bar-title: given {} times; the picture shows {}", arguments.bar_titles.size(),
                     countText(shown.size(), "function"));
  for (size_t n = 0; n < arguments.bar_titles.size(); ++n) shown[n].title = arguments.bar_titles[n];
  return shown;
}

}  // namespace curvisplat
