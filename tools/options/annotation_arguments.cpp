#include "tools/options/annotation_arguments.h"

#include <algorithm>

#include "stream/base/count_text.h"
#include "stream/base/error.h"

namespace curvisplat {

void addAnnotationOptions(CLI::App& command, AnnotationArguments& arguments, const std::string& group) {
  command
      .add_flag("--scalar-bar", arguments.shown.scalar_bar,
                "Draw scalar bars beside the data, one for each function that is shown")
      ->group(group);
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
                "Draw a grid behind the data, with coordinates (before --scale) along its edges")
      ->group(group);
  command
      .add_option(
          "--axes-titles", arguments.axis_titles,
          "Titles of the axes grid, X,Y,Z, such as \"x [m],y [m],depth [m]\" (default x,y,z); implies "
          "--axes-grid")
      ->group(group);
  command.add_flag("--outline", arguments.shown.outline, "Draw the bounding box of the data")->group(group);
}

void checkAnnotationArguments(const AnnotationArguments& arguments) {
  axisTitles(arguments);
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

ShownBox shownBox(const Manifest& manifest, const glm::dvec3& scale, const Annotations& annotations) {
  constexpr double kAxesRoom = 0.17;  // of the box
  const glm::dvec3 lower = manifest.lower * scale, upper = manifest.upper * scale;
  const glm::dvec3 room = (annotations.axes_grid ? kAxesRoom : 0.0) * (upper - lower);
  return {lower - room, upper + room};
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
  shown.push_back({&coloured.function, titleOf(coloured.variable)});
  const bool volume = !scene || scene->volume;
  if (scalars.colour && volume)
    shown.push_back({&scalars.opacity.function, titleOf(scalars.opacity.variable) + " (opacity)", true});
  if (scene)
    for (const GridSurface& surface : scene->grid_surfaces) {
      if (!surface.function) continue;
      const auto info = std::find_if(manifest.variables.begin(), manifest.variables.end(),
                                     [&](const VariableInfo& of) { return of.name == surface_by; });
      shown.push_back({surface.function.get(),
                       info == manifest.variables.end() ? surface_by : scalarTitle(info->name, info->unit)});
      break;
    }
  if (arguments.bar_titles.size() > shown.size())
    throw UsageError("--scalar-bar-title: given {} times; the picture shows {}", arguments.bar_titles.size(),
                     countText(shown.size(), "function"));
  for (size_t n = 0; n < arguments.bar_titles.size(); ++n) shown[n].title = arguments.bar_titles[n];
  return shown;
}

}  // namespace curvisplat
