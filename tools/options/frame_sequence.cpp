#include "tools/options/frame_sequence.h"

#include <CLI/CLI.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <system_error>
#include <utility>

#include "preprocess/formats/open/series_files.h"
#include "render/camera/camera_path.h"
#include "render/film/film.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

/// An angle in degrees, 0 without one. Frames multiply it, so that it must be far from what a double holds.
double degreesOf(const std::string& option, const std::optional<std::string>& text) {
  constexpr double kMax = 1e6;
  const double degrees = text ? parseNumber(option, *text) : 0;
  if (!(std::abs(degrees) <= kMax))
    throw UsageError("{} {}: expected degrees from {:g} to {:g}", option, *text, -kMax, kMax);
  return degrees;
}

/// The camera before --roll and --zoom. Rolling counts for what fits.
Camera placedCamera(const CameraArguments& arguments, const ShownBox& box, ImageSize size) {
  const auto projection = arguments.view_angle ? Projection::kPerspective : Projection::kOrthographic;
  const double angle = arguments.view_angle ? parsePositive("--view-angle", *arguments.view_angle) : 30;
  if (angle >= 180)
    throw UsageError("--view-angle {}: expected fewer than 180 degrees", *arguments.view_angle);
  const auto turned = [&](const Camera& camera) {
    return elevated(orbited(camera, degreesOf("--azimuth", arguments.azimuth)),
                    degreesOf("--elevation", arguments.elevation));
  };
  const double roll = degreesOf("--roll", arguments.roll);

  Camera camera;
  if (arguments.position) {
    camera.position = parsePoint("--position", *arguments.position);
    camera.focal_point = arguments.focal_point ? parsePoint("--focal-point", *arguments.focal_point)
                                               : 0.5 * (box.lower + box.upper);
    camera.view_up = arguments.view_up ? parsePoint("--view-up", *arguments.view_up) : glm::dvec3(0, 0, 1);
    if (glm::length(camera.view_up) == 0)
      throw UsageError("--view-up {}: expected a direction other than 0,0,0", *arguments.view_up);
    camera.projection = projection;
    camera.view_angle_deg = angle;
    camera = turned(camera);
    camera.parallel_scale = rolled(camera, roll).parallelScaleFor(box.lower, box.upper, size);
  } else {
    camera = Camera::named(arguments.view.value_or("iso"), box.lower, box.upper, size, projection, angle);
    if (arguments.turn()) {
      camera = turned(camera);
      Camera fitted = rolled(camera, roll);
      fitted.fit(box.lower, box.upper, size);
      camera.position = fitted.position;
      camera.parallel_scale = fitted.parallel_scale;
    }
    if (arguments.focal_point) {
      const glm::dvec3 moved = parsePoint("--focal-point", *arguments.focal_point) - camera.focal_point;
      camera.position += moved;
      camera.focal_point += moved;
    }
  }
  if (arguments.parallel_scale)
    camera.parallel_scale = parsePositive("--parallel-scale", *arguments.parallel_scale);
  return camera;
}

}  // namespace

void addCameraOptions(CLI::App& command, CameraArguments& arguments, const std::string& group,
                      const std::string& note) {
  const auto add = [&](const char* name, std::optional<std::string>& value, const std::string& help) {
    command.add_option(name, value, help)->group(group);
  };
  add("--view", arguments.view, "Side the camera looks from: iso, +x, -x, +y, -y, +z or -z" + note);
  add("--view-angle", arguments.view_angle,
      "Perspective with this vertical view angle, in degrees (default: orthographic)");
  add("--azimuth", arguments.azimuth,
      "Turn the camera, given or chosen, by this angle about the up direction, to its right, in degrees");
  add("--elevation", arguments.elevation, "Raise it by this angle about the focal point, in degrees");
  add("--roll", arguments.roll, "Roll it by this angle about its line of sight, in degrees");
  add("--zoom", arguments.zoom, "Show everything this many times as large; below 1, smaller");
}

void addPlaceOptions(CLI::App& command, CameraArguments& arguments, const std::string& group) {
  const auto add = [&](const char* name, std::optional<std::string>& value, const char* help) {
    command.add_option(name, value, help)->group(group);
  };
  add("--position", arguments.position,
      "Camera position x,y,z, in coordinates after --scale. Alone it looks at the data's centre, z up, and "
      "fits "
      "the data into the picture");
  add("--focal-point", arguments.focal_point, "Point x,y,z the camera looks at (default: the data's centre)");
  add("--view-up", arguments.view_up, "Up direction x,y,z of the picture (default 0,0,1)");
  add("--parallel-scale", arguments.parallel_scale,
      "Half the picture's height in world units (default: fits the data)");
}

void checkCameraArguments(const CameraArguments& arguments) {
  if (arguments.view && (arguments.position || arguments.view_up))
    throw UsageError("--view cannot be combined with --position or --view-up");
  if (arguments.look_at.has_value() != arguments.from_height.has_value())
    throw UsageError("--look-at and --from-height need one another");
  if (arguments.look_at &&
      (arguments.view || arguments.position || arguments.focal_point || arguments.view_up))
    throw UsageError(
        "--look-at cannot be combined with --view, --position, --focal-point or --view-up; all place the "
        "camera");
  if (!arguments.position && arguments.view_up) throw UsageError("--view-up needs --position");
  if (!arguments.position && !arguments.view && arguments.focal_point)
    throw UsageError("--focal-point needs --position or --view");
  if (arguments.parallel_scale && arguments.view_angle)
    throw UsageError("--parallel-scale (orthographic) cannot be combined with --view-angle (perspective)");
  if (arguments.orbit && !arguments.path.empty())
    throw UsageError("--orbit cannot be combined with --path; both move the camera");
  for (const auto& [name, value] : {std::pair("--azimuth", &arguments.azimuth),
                                    {"--elevation", &arguments.elevation},
                                    {"--roll", &arguments.roll}})
    degreesOf(name, *value);
  if (arguments.zoom) parsePositive("--zoom", *arguments.zoom);
  if (!arguments.path.empty() && (arguments.turn() || arguments.zoom))
    throw UsageError(
        "--path {}: its key frames place the camera; remove --azimuth, --elevation, --roll and --zoom",
        arguments.path.string());
  if (!arguments.path.empty() && (arguments.view || arguments.position || arguments.look_at ||
                                  arguments.parallel_scale || arguments.view_angle))
    throw UsageError(
        "--path {}: its key frames place the camera; remove --view, --position, --look-at, --parallel-scale "
        "and --view-angle",
        arguments.path.string());
  if (arguments.frames && !arguments.moves())
    throw UsageError("--frames needs --orbit, --path, or --steps with --interpolate");
}

namespace {

/// The placed camera at a frame of its orbit, rolled.
std::function<Camera(const Camera& placed, uint64_t frame)> turnOf(const CameraArguments& arguments) {
  const double degrees = degreesOf("--orbit", arguments.orbit), roll = degreesOf("--roll", arguments.roll);
  return [=, frames = static_cast<double>(arguments.frameCount())](const Camera& placed, uint64_t frame) {
    return rolled(orbited(placed, degrees * static_cast<double>(frame) / frames), roll);
  };
}

}  // namespace

std::optional<double> fittingScale(const CameraArguments& arguments, const ShownBox& box, ImageSize size) {
  if (arguments.parallel_scale || arguments.view_angle || !arguments.path.empty()) return std::nullopt;
  const Camera placed = placedCamera(arguments, box, size);
  double scale = placed.parallel_scale;
  const auto turned = turnOf(arguments);
  for (uint64_t frame = 0; arguments.orbit && frame < arguments.frameCount(); ++frame)
    scale = std::max(scale, turned(placed, frame).parallelScaleFor(box.lower, box.upper, size));
  return scale;
}

CameraMotion chooseCameraMotion(const CameraArguments& arguments, const ShownBox& box, ImageSize size) {
  const uint64_t frames = arguments.frameCount();
  if (!arguments.path.empty()) {
    const auto film =
        arguments.film ? arguments.film : std::make_shared<const Film>(Film::fromFile(arguments.path));
    const auto time = [=](uint64_t frame) { return film->timeOf(frame, frames); };
    CameraMotion motion{frames, [=](uint64_t frame) { return film->cameras().at(time(frame)); }, {}};
    if (film->cameras().hasSeriesTimes())
      motion.series_time = [=](uint64_t frame) { return film->cameras().seriesTimeAt(time(frame)); };
    if (film->stated().any()) motion.look = [=](uint64_t frame) { return film->lookAt(time(frame)); };
    return motion;
  }
  Camera first = placedCamera(arguments, box, size);
  if (const auto scale = fittingScale(arguments, box, size)) first.parallel_scale = *scale;
  const double zoom = arguments.zoom ? parsePositive("--zoom", *arguments.zoom) : 1;
  if (first.projection == Projection::kPerspective && !(first.view_angle_deg / zoom < 180))
    throw UsageError("--zoom {}: the view angle of {:g} degrees becomes {:g}; expected fewer than 180",
                     *arguments.zoom, first.view_angle_deg, first.view_angle_deg / zoom);
  const auto at = [=, turned = turnOf(arguments)](uint64_t frame) {
    return magnified(turned(first, frame), zoom);
  };
  if (!arguments.orbit) return {1, [camera = at(0)](uint64_t) { return camera; }, {}};
  return {frames, at, {}};
}

namespace {

/// Notes that a time lies outside of the series: perhaps it is in another unit.
void noteTimeOutside(const std::string& time, const Series& series, const StepPosition& position) {
  const double number = parseNumber("--time", time), first = series.steps.front().time,
               last = series.steps.back().time;
  if (number < first || number > last)
    printMessage("note: --time {}: the series has times from {:g} to {:g}; step {} is taken", time, first,
                 last, position.step);
}

/// Notes that the last of the steps that were asked for is not there.
void noteStepsBeyond(const std::string& steps, const Series& series) {
  const std::optional<uint64_t> last = parseSteps("--steps", steps).last;
  if (last && *last >= series.steps.size())
    printMessage("note: --steps {}: the last step is {}", steps, series.steps.size() - 1);
}

}  // namespace

void addStepOptions(CLI::App& command, StepArguments& arguments, const std::string& group) {
  CLI::Option* const step =
      command.add_option("--step", arguments.step, "Time step of the cache, counted from 0 (default 0)")
          ->group(group);
  command.add_option("--time", arguments.time, "Choose the time step nearest to this time")
      ->group(group)
      ->excludes(step);
}

void addInterpolateOption(CLI::App& command, StepArguments& arguments, const std::string& group) {
  command
      .add_flag(
          "--interpolate", arguments.interpolates,
          "Draw times between two steps of one grid by linear interpolation of their values, instead of "
          "the nearest step")
      ->group(group);
}

std::vector<StepPosition> chosenSteps(const StepArguments& arguments, const CacheReader& cache) {
  if (arguments.steps && (arguments.step || arguments.time))
    throw UsageError("--steps cannot be combined with --step or --time, which choose one");
  const Series& series = cache.series();
  if (arguments.steps) {
    std::vector<StepPosition> positions;
    for (const uint64_t step :
         selectedSteps("--steps", parseSteps("--steps", *arguments.steps), series.steps.size()))
      positions.push_back({step});
    return positions;
  }
  if (arguments.time) {
    const double time = parseNumber("--time", *arguments.time);
    return {arguments.interpolates ? series.between(time) : StepPosition{series.nearest(time)}};
  }
  const uint64_t step = arguments.step.value_or(0);
  if (step >= series.steps.size())
    throw UsageError("--step {}: is out of range; {} has {}", step, cache.cachePath().string(),
                     series.steps.size() == 1
                         ? "one time step, 0; of files with more, `convert --steps all` makes a cache of all"
                         : fmt::format("steps 0 to {}", series.steps.size() - 1));
  return {{step}};
}

CacheReader openAtStep(const std::filesystem::path& path, const StepArguments& arguments,
                       std::string_view scalar) {
  CacheReader cache = CacheReader::ofScalar(path, scalar);
  const StepPosition position = chosenSteps(arguments, cache).front();
  if (arguments.time) noteTimeOutside(*arguments.time, cache.series(), position);
  if (arguments.steps) noteStepsBeyond(*arguments.steps, cache.series());
  return position == cache.position() ? std::move(cache) : cache.at(position);
}

void checkMotionArguments(const CameraArguments& camera, const StepArguments& steps) {
  if (steps.interpolates && !steps.time && !steps.steps && camera.path.empty())
    throw UsageError("--interpolate needs --time, --steps or a --path whose key frames have times");
  CameraArguments without_time = camera;
  if (steps.interpolates && steps.steps) without_time.frames.reset();
  checkCameraArguments(without_time);
}

CameraArguments framesOf(const CameraArguments& arguments, const std::vector<StepPosition>& steps) {
  CameraArguments with_frames = arguments;
  if (arguments.moves() && !arguments.frames && steps.size() > 1) with_frames.frames = steps.size();
  return with_frames;
}

MotionInTime inTime(const CameraMotion& motion, const Series& series, const StepArguments& arguments,
                    const std::vector<StepPosition>& chosen, std::optional<uint64_t> frames) {
  const auto at = [&series, interpolates = arguments.interpolates](double time) {
    return interpolates ? series.between(time) : StepPosition{series.nearest(time)};
  };
  MotionInTime timed{motion.frames, motion.camera, {}, motion.look};
  if (motion.series_time) {
    if (arguments.step || arguments.time || arguments.steps)
      throw UsageError(
          "--path: its key frames have times of the series; leave out --step, --time and --steps");
    timed.position = [at, time = motion.series_time](uint64_t frame) { return at(time(frame)); };
    return timed;
  }
  if (timed.frames == 1 && chosen.size() > 1) {
    timed.frames = arguments.interpolates ? frames.value_or(chosen.size()) : chosen.size();
    timed.camera = [camera = motion.camera(0)](uint64_t) { return camera; };
  }
  const uint64_t count = timed.frames;
  if (arguments.interpolates && chosen.size() > 1 && count > 1) {
    const double first = series.timeAt(chosen.front()), last = series.timeAt(chosen.back());
    timed.position = [=, end = chosen.back()](uint64_t frame) {
      const double part = static_cast<double>(frame) / static_cast<double>(count - 1);
      return frame + 1 == count ? end : at(first + part * (last - first));
    };
    return timed;
  }
  timed.position = [chosen, count](uint64_t frame) { return chosen[frame * chosen.size() / count]; };
  return timed;
}

namespace {

/// 0 where the text is not a whole number.
uint64_t numberOrZero(const char* begin, const char* end) {
  uint64_t number = 0;
  const auto [stop, error] = std::from_chars(begin, end, number);
  return error == std::errc{} && stop == end ? number : 0;
}

}  // namespace

std::vector<uint64_t> FramePart::of(uint64_t frames) const {
  std::vector<uint64_t> numbers;
  for (uint64_t number = index; number < frames; number += count) numbers.push_back(number);
  return numbers;
}

FramePart parsePart(const std::string& text) {
  const size_t slash = text.find('/');
  uint64_t part = 0, parts = 0;
  if (slash != std::string::npos) {
    part = numberOrZero(text.data(), text.data() + slash);
    parts = numberOrZero(text.data() + slash + 1, text.data() + text.size());
  }
  if (part < 1 || part > parts || parts > kMaxFrames)
    throw UsageError("--part {}: expected i/n with i from 1 to n and n up to {}, such as 3/8", text,
                     kMaxFrames);
  return {part - 1, parts};
}

}  // namespace curvisplat
