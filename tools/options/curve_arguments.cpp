#include "tools/options/curve_arguments.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "preprocess/formats/netcdf/cf_trajectories.h"
#include "preprocess/formats/vtk/vtk_curves.h"
#include "render/annotate/globe_box.h"
#include "render/colour/function_parts.h"
#include "render/mesh/curve_set.h"
#include "render/surface/curve_times.h"
#include "stream/base/calendar.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/globe_arguments.h"
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

/// The cache and the globe that lines are placed in, and whether their times are the series'.
struct Place {
  const CacheReader& cache;
  const std::optional<Globe>& globe;
  bool follows_time, must_follow;
};

/// The part of a map that is drawn: around the data, by a tenth of its longitudes and latitudes more.
GeographicBox mapAround(const Place& place) {
  constexpr double kBeyond = 0.1;
  const auto box = boxOnGlobe(place.cache, place.globe);
  if (!box) return {};
  const glm::dvec2 lower(box->lower), upper(box->upper), beyond = kBeyond * (upper - lower);
  return {lower - beyond, upper + beyond};
}

/// The times of trajectories in the unit of the cache's; none where they do not compare.
std::vector<double> timesOf(const CfTrajectories& trajectories, const TimeUnit& unit) {
  std::vector<double> times = trajectories.times;
  const TimeUnit& from = trajectories.time_unit;
  if (times.empty() || (from.name.empty() && unit.name.empty())) return times;
  // The line through two times far apart: a conversion of each would parse the units again.
  double span = 1;
  for (const double time : times) span = std::max(span, std::abs(time));
  const auto none = timeInUnit(0, from, unit), most = timeInUnit(span, from, unit);
  if (!none || !most) return {};
  const double factor = (*most - *none) / span;
  for (double& time : times) time = *none + factor * time;
  return times;
}

CurveSet setOf(CfTrajectories trajectories, const std::filesystem::path& path, const Place& place) {
  const bool lengths = place.globe && !place.globe->degrees();
  if (trajectories.degrees) requireGlobe(place.globe, path);
  if (!trajectories.degrees && place.globe && !lengths)
    throw Error("{}: has lengths, but the grid of the cache has longitudes and latitudes", path.string());
  const TimeUnit unit{place.cache.seriesManifest().time_unit, place.cache.seriesManifest().calendar};
  std::vector<double> times = timesOf(trajectories, unit);
  if (times.empty() && !trajectories.times.empty() && place.follows_time) {
    const std::string why =
        fmt::format("{}: its times, in '{}', do not compare with those of the cache, in '{}'", path.string(),
                    trajectories.time_unit.name, unit.name);
    if (place.must_follow) throw Error("{}; --lines-time all draws whole lines", why);
    printMessage("note: {}; whole lines are drawn", why);
  }
  // Lengths of a grid that no NetCDF file describes are what they are there.
  for (glm::dvec3& point : trajectories.points)
    point = place.globe ? place.globe->placeAt(point) : 1e3 * point;
  CurveSet set = curveSetOf(trajectories.points, std::move(trajectories.begins),
                            std::move(trajectories.values), std::move(times));
  set.on_sphere = trajectories.degrees && place.globe->sphere();
  return set;
}

CurveSet read(const std::filesystem::path& path, const std::string& scalar, bool as_points,
              const Place& place) {
  if (isVtkCurveFile(path)) {
    VtkCurves curves = readVtkCurves(path, scalar, as_points);
    return curveSetOf(curves.points, std::move(curves.begins), std::move(curves.values));
  }
  const std::string extension = extensionOf(path);
  if (extension == ".csv" || extension == ".txt")
    return parseCurveText(readTextFile(path, kMaxBytes), path, scalar, place.globe);
  if (extension == ".geojson" || extension == ".json" || extension == ".shp") {
    requireGlobe(place.globe, path);
    const auto parse = extension == ".shp" ? parseShapefile : parseGeoJson;
    return parse(readTextFile(path, kMaxBytes), path, *place.globe, mapAround(place));
  }
  if (isTrajectoryFile(path)) return setOf(readCfTrajectories(path, scalar), path, place);
  throw Error(
      "{}: is no file of lines or points by its ending; expected .vtp, .vtu, .vtk, .csv, .txt, .geojson or "
      ".shp, "
      "or NetCDF",
      path.string());
}

/// How much of trajectories is drawn.
struct TimeShown {
  bool all = false;
  std::optional<double> tail;
};

TimeShown parseTimeShown(const std::string& text) {
  if (text == "all") return {true, std::nullopt};
  if (text == "past") return {};
  return {false, parsePositive("--lines-time", text)};
}

/// Sets what the step's time shows of lines that have times.
void followSeries(Curves& curves, const std::optional<std::string>& time, bool follows) {
  if (!follows || curves.set->times.empty()) {
    if (curves.places && curves.set->lines() < curves.set->positions.size())
      curves.set = std::make_shared<CurveSet>(pointsOf(*curves.set));
    return;
  }
  curves.whole = curves.set;
  if (time) curves.tail = parseTimeShown(*time).tail;
}

}  // namespace

void addCurveOptions(CLI::App& command, CurveArguments& arguments, const std::string& group) {
  const auto repeatable = [&](const char* name, std::vector<std::string>& values, const char* help) {
    command.add_option(name, values, help)->take_all()->allow_extra_args(false)->group(group);
  };
  repeatable(
      "--lines", arguments.lines,
      "Lines in the volume as lit tubes, such as streamlines: a .vtp, .vtu or legacy .vtk file, or .csv with "
      "columns x,y,z[,scalar...][,id], in coordinates before --scale; trajectories in NetCDF or Zarr; coasts "
      "as "
      "GeoJSON or a shapefile; repeatable");
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
  command
      .add_option(
          "--lines-time", arguments.time,
          "Of lines with times: past, up to the time of the picture; a number, only the last so long "
          "before it; all, the whole lines. Points are where they are at that time, or with all, at all "
          "times (default: past for a series of time steps, otherwise all)")
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
  if (arguments.time) parseTimeShown(*arguments.time);
  for (const std::string& colour : arguments.colours) parseColour("lines", colour);
  const CurveArguments otherwise;
  if (arguments.lines.empty() && arguments.line_width != otherwise.line_width)
    throw UsageError("--line-width needs lines: --lines FILE");
  if (arguments.points.empty() && arguments.point_size != otherwise.point_size)
    throw UsageError("--point-size needs points: --points FILE");
  const size_t files = arguments.lines.size() + arguments.points.size();
  if (arguments.colours.size() > 1 && arguments.colours.size() != files)
    throw UsageError("--lines-colour: given {} times for {} files; give it once, or once for each file",
                     arguments.colours.size(), files);
  if (files > 0) return;
  if (!arguments.colours.empty()) throw UsageError("--lines-colour needs lines or points: --lines FILE");
  if (!arguments.by.empty()) throw UsageError("--lines-by needs lines or points: --lines FILE");
  if (arguments.time) throw UsageError("--lines-time needs lines or points: --lines FILE");
  if (parseCurveOpacity(arguments.opacity) != parseCurveOpacity(otherwise.opacity))
    throw UsageError("--lines-opacity needs lines or points: --lines FILE");
}

std::vector<Curves> curvesOf(const CurveArguments& arguments, const CacheReader& cache,
                             const std::optional<Globe>& globe, const std::string& drawn) {
  std::vector<Curves> all;
  const bool of_series = cache.series().steps.size() > 1;
  const bool follows = arguments.time ? !parseTimeShown(*arguments.time).all : of_series;
  const Place place{cache, globe, follows, follows && arguments.time};
  for (const auto& [files, as_points] : {std::pair(&arguments.lines, false), {&arguments.points, true}})
    for (const std::string& file : *files) {
      const size_t n = all.size();
      Curves& curves = all.emplace_back();
      CurveSet set = read(file, arguments.by, as_points, place);
      // Places that are drawn are those of the file; where they are at other times lies on the way between these.
      const bool has_ways = !as_points || (follows && !set.times.empty());
      curves.set = std::make_shared<CurveSet>(set.on_sphere && has_ways ? alongSphere(set) : std::move(set));
      curves.places = as_points;
      followSeries(curves, arguments.time, follows);
      const Width width = as_points ? parseWidth("--point-size", arguments.point_size)
                                    : parseWidth("--line-width", arguments.line_width);
      curves.width = width.width;
      curves.in_pixels = width.in_pixels;
      curves.opacity = parseCurveOpacity(arguments.opacity);
      if (!arguments.colours.empty())
        curves.colour = parseColour("lines", arguments.colours[arguments.colours.size() == 1 ? 0 : n]);
    }
  if (arguments.by.empty() || arguments.by == drawn || all.empty())
    return curvesAt(std::move(all), cache.time());
  // The range is that of whole lines, so that colours are the same at all times.
  std::optional<std::pair<double, double>> range;
  for (const Curves& curves : all) {
    if (curves.set->values.empty()) continue;  // coasts beside trajectories
    const auto [low, high] = curves.set->range();
    range = range ? std::pair(std::min(range->first, double{low}), std::max(range->second, double{high}))
                  : std::pair(double{low}, double{high});
  }
  if (!range) throw Error("--lines-by {}: the files have no scalars; leave it out", arguments.by);
  FunctionParts parts;
  parts.map = kMap;
  parts.range = intervalAround(range->first, range->second);
  const auto function = std::make_shared<TransferFunction>(parts.function());
  const auto colours = std::make_shared<ColourTable>(*function);
  for (Curves& curves : all) {
    curves.function = function;
    curves.colours = colours;
    curves.title = arguments.by;
  }
  return curvesAt(std::move(all), cache.time());
}

}  // namespace curvisplat
