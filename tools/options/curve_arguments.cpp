#include "tools/options/curve_arguments.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "preprocess/formats/vtk/vtk_curves.h"
#include "render/colour/function_parts.h"
#include "render/mesh/curve_set.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

constexpr const char* kMap = "plasma";             // not that of most volumes
constexpr uint64_t kMaxBytes = uint64_t{2} << 30;  // of a file of text

struct Width {
  double width;
  bool in_pixels;
};

Width parseWidth(const std::string& option, const std::string& text) {
  const bool in_pixels = text.ends_with("px");
  return {parsePositive(option, in_pixels ? text.substr(0, text.size() - 2) : text), in_pixels};
}

double parseCurveOpacity(const std::string& text) {
  const double opacity = parseNumber("--lines-opacity", text);
  if (!(opacity > 0 && opacity <= 1))
    throw UsageError("--lines-opacity {}: expected a number above 0 and at most 1", text);
  return opacity;
}

glm::vec3 parseCurveColour(const std::string& text) {
  if (text == "transparent")
    throw UsageError("--lines-colour transparent: give #rrggbb, and --lines-opacity");
  return glm::vec3(parseBackground("--lines-colour", text));
}

std::shared_ptr<const CurveSet> read(const std::filesystem::path& path, const std::string& scalar,
                                     bool as_points) {
  if (isVtkCurveFile(path)) {
    VtkCurves curves = readVtkCurves(path, scalar, as_points);
    return std::make_shared<CurveSet>(
        curveSetOf(curves.points, std::move(curves.begins), std::move(curves.values)));
  }
  const std::string extension = extensionOf(path);
  if (extension != ".csv" && extension != ".txt")
    throw Error("{}: is no file of lines or points by its ending; expected .vtp, .vtu, .vtk, .csv or .txt",
                path.string());
  return std::make_shared<CurveSet>(parseCurveText(readTextFile(path, kMaxBytes), path, scalar, as_points));
}

}  // namespace

void addCurveOptions(CLI::App& command, CurveArguments& arguments, const std::string& group) {
  const auto repeatable = [&](const char* name, std::vector<std::string>& values, const char* help) {
    command.add_option(name, values, help)->take_all()->allow_extra_args(false)->group(group);
  };
  repeatable(
      "--lines", arguments.lines,
      "Lines in the volume as lit tubes, such as streamlines: a .vtp, .vtu or legacy .vtk file, or .csv with "
      "columns x,y,z[,scalar...][,id], in coordinates before --scale; repeatable");
  repeatable("--points", arguments.points, "Points of such a file as lit spheres; repeatable");
  command
      .add_option("--line-width", arguments.line_width,
                  "Diameter of tubes, in pixels (3px) or in world units after --scale (0.02)")
      ->capture_default_str()
      ->group(group);
  command.add_option("--point-size", arguments.point_size, "Diameter of spheres, as --line-width")
      ->capture_default_str()
      ->group(group);
  command
      .add_option(
          "--lines-by", arguments.by,
          "Colour lines and points by this scalar of their files, by the transfer function if it has the "
          "name of the scalar drawn, otherwise by a colour map over their values")
      ->group(group);
  repeatable("--lines-colour", arguments.colours,
             "Colour #rrggbb of lines and points, or one for each file in their order, lines first (default "
             "#b3b3b3)");
  command
      .add_option("--lines-opacity", arguments.opacity, "Opacity of lines and points, above 0 and at most 1")
      ->capture_default_str()
      ->group(group);
}

void checkCurveArguments(const CurveArguments& arguments) {
  parseWidth("--line-width", arguments.line_width);
  parseWidth("--point-size", arguments.point_size);
  parseCurveOpacity(arguments.opacity);
  for (const std::string& colour : arguments.colours) parseCurveColour(colour);
  const size_t files = arguments.lines.size() + arguments.points.size();
  if (arguments.colours.size() > 1 && arguments.colours.size() != files)
    throw UsageError("--lines-colour: given {} times for {} files; give it once, or once for each file",
                     arguments.colours.size(), files);
  if (files > 0) return;
  if (!arguments.colours.empty()) throw UsageError("--lines-colour needs lines or points: --lines FILE");
  if (!arguments.by.empty()) throw UsageError("--lines-by needs lines or points: --lines FILE");
}

std::vector<Curves> curvesOf(const CurveArguments& arguments, const std::string& drawn) {
  std::vector<Curves> all;
  for (const auto& [files, as_points] : {std::pair(&arguments.lines, false), {&arguments.points, true}})
    for (const std::string& file : *files) {
      const size_t n = all.size();
      Curves& curves = all.emplace_back();
      curves.set = read(file, arguments.by, as_points);
      const Width width = as_points ? parseWidth("--point-size", arguments.point_size)
                                    : parseWidth("--line-width", arguments.line_width);
      curves.width = width.width;
      curves.in_pixels = width.in_pixels;
      curves.opacity = parseCurveOpacity(arguments.opacity);
      if (!arguments.colours.empty())
        curves.colour = parseCurveColour(arguments.colours[arguments.colours.size() == 1 ? 0 : n]);
    }
  if (arguments.by.empty() || arguments.by == drawn || all.empty()) return all;
  std::pair<double, double> range = all.front().set->range();
  for (const Curves& curves : all) {
    const auto [low, high] = curves.set->range();
    range = {std::min(range.first, double{low}), std::max(range.second, double{high})};
  }
  FunctionParts parts;
  parts.map = kMap;
  parts.range = intervalAround(range.first, range.second);
  const auto function = std::make_shared<TransferFunction>(parts.function());
  const auto colours = std::make_shared<ColourTable>(*function);
  for (Curves& curves : all) {
    curves.function = function;
    curves.colours = colours;
    curves.title = arguments.by;
  }
  return all;
}

}  // namespace curvisplat
