#include "tools/options/camera_motion.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <memory>
#include <utility>

#include "render/camera/camera_path.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

Camera placedCamera(const CameraArguments& arguments, const glm::dvec3& lower, const glm::dvec3& upper,
                    ImageSize size) {
  const auto projection = arguments.view_angle ? Projection::kPerspective : Projection::kOrthographic;
  const double angle = arguments.view_angle ? parsePositive("--view-angle", *arguments.view_angle) : 30;
  if (angle >= 180)
    throw UsageError("--view-angle {}: expected fewer than 180 degrees", *arguments.view_angle);

  Camera camera;
  if (arguments.position) {
    camera.position = parsePoint("--position", *arguments.position);
    camera.focal_point =
        arguments.focal_point ? parsePoint("--focal-point", *arguments.focal_point) : 0.5 * (lower + upper);
    camera.view_up = arguments.view_up ? parsePoint("--view-up", *arguments.view_up) : glm::dvec3(0, 0, 1);
    if (glm::length(camera.view_up) == 0)
      throw UsageError("--view-up {}: expected a direction other than 0,0,0", *arguments.view_up);
    camera.projection = projection;
    camera.view_angle_deg = angle;
    camera.parallel_scale = camera.parallelScaleFor(lower, upper, size);
  } else {
    camera = Camera::named(arguments.view.value_or("iso"), lower, upper, size, projection, angle);
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

void checkCameraArguments(const CameraArguments& arguments) {
  if (arguments.view && (arguments.position || arguments.view_up))
    throw UsageError("--view cannot be combined with --position or --view-up");
  if (!arguments.position && arguments.view_up) throw UsageError("--view-up needs --position");
  if (!arguments.position && !arguments.view && arguments.focal_point)
    throw UsageError("--focal-point needs --position or --view");
  if (arguments.parallel_scale && arguments.view_angle)
    throw UsageError("--parallel-scale (orthographic) cannot be combined with --view-angle (perspective)");
  if (arguments.orbit && !arguments.path.empty())
    throw UsageError("--orbit cannot be combined with --path; both move the camera");
  if (!arguments.path.empty() &&
      (arguments.view || arguments.position || arguments.parallel_scale || arguments.view_angle))
    throw UsageError(
        "--path {}: its key frames place the camera; remove --view, --position, --parallel-scale and "
        "--view-angle",
        arguments.path.string());
  if (arguments.frames && !arguments.moves()) throw UsageError("--frames needs --orbit or --path");
}

CameraMotion chooseCameraMotion(const CameraArguments& arguments, const glm::dvec3& lower,
                                const glm::dvec3& upper, ImageSize size) {
  const uint64_t frames = arguments.frameCount();
  if (!arguments.path.empty()) {
    const auto path = std::make_shared<CameraPath>(CameraPath::fromFile(arguments.path));
    const double step = frames > 1 ? (path->end() - path->begin()) / static_cast<double>(frames - 1) : 0;
    const auto time = [=](uint64_t frame) {
      return frame + 1 == frames && frames > 1 ? path->end()
                                               : path->begin() + step * static_cast<double>(frame);
    };
    CameraMotion motion{frames, [=](uint64_t frame) { return path->at(time(frame)); }, {}};
    if (path->hasSeriesTimes())
      motion.series_time = [=](uint64_t frame) { return path->seriesTimeAt(time(frame)); };
    return motion;
  }
  Camera first = placedCamera(arguments, lower, upper, size);
  if (!arguments.orbit) return {1, [=](uint64_t) { return first; }, {}};
  const double degrees = parseNumber("--orbit", *arguments.orbit);
  const auto turn = [=](uint64_t frame) {
    return degrees * static_cast<double>(frame) / static_cast<double>(frames);
  };
  if (!arguments.parallel_scale && first.projection == Projection::kOrthographic)
    for (uint64_t frame = 0; frame < frames; ++frame)  // one scale that fits the data into every frame
      first.parallel_scale =
          std::max(first.parallel_scale, orbited(first, turn(frame)).parallelScaleFor(lower, upper, size));
  return {frames, [=](uint64_t frame) { return orbited(first, turn(frame)); }, {}};
}

}  // namespace curvisplat
