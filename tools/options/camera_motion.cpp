#include "tools/options/camera_motion.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <memory>

#include "render/camera/camera_path.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

Camera placedCamera(const CameraWords& words, const glm::dvec3& lower, const glm::dvec3& upper,
                    ImageSize size) {
  const auto projection = words.view_angle ? Projection::kPerspective : Projection::kOrthographic;
  const double angle = words.view_angle ? parsePositive("--view-angle", *words.view_angle) : 30;
  if (angle >= 180) throw UsageError("--view-angle {}: expected less than 180 degrees", *words.view_angle);

  Camera camera;
  if (words.position) {
    camera.position = parsePoint("--position", *words.position);
    camera.focal_point =
        words.focal_point ? parsePoint("--focal-point", *words.focal_point) : 0.5 * (lower + upper);
    camera.view_up = words.view_up ? parsePoint("--view-up", *words.view_up) : glm::dvec3(0, 0, 1);
    if (glm::length(camera.view_up) == 0)
      throw UsageError("--view-up {}: expected a direction", *words.view_up);
    camera.projection = projection;
    camera.view_angle_deg = angle;
    camera.parallel_scale = camera.parallelScaleFor(lower, upper, size);
  } else {
    camera = Camera::named(words.view.value_or("iso"), lower, upper, size, projection, angle);
  }
  if (words.parallel_scale) camera.parallel_scale = parsePositive("--parallel-scale", *words.parallel_scale);
  return camera;
}

}  // namespace

void checkCameraWords(const CameraWords& words) {
  if (words.view && (words.position || words.focal_point || words.view_up))
    throw UsageError("--view names a camera; --position, --focal-point and --view-up place one: give either");
  if (!words.position && (words.focal_point || words.view_up))
    throw UsageError("{} needs --position", words.focal_point ? "--focal-point" : "--view-up");
  if (words.parallel_scale && words.view_angle)
    throw UsageError(
        "--parallel-scale is for an orthographic camera, --view-angle for perspective: give one");
  if (words.orbit && !words.path.empty())
    throw UsageError("--orbit and --path both move the camera: give one");
  if (!words.path.empty() && (words.view || words.position || words.parallel_scale || words.view_angle))
    throw UsageError(
        "--path {}: its key frames place the camera; leave out --view, --position, "
        "--parallel-scale and --view-angle",
        words.path.string());
  if (words.moves() && !words.frames)
    throw UsageError("{} needs --frames", words.orbit ? "--orbit" : "--path");
  if (words.frames && !words.moves()) throw UsageError("--frames needs --orbit or --path");
}

CameraMotion chooseCameraMotion(const CameraWords& words, const glm::dvec3& lower, const glm::dvec3& upper,
                                ImageSize size) {
  const uint64_t frames = words.frames.value_or(1);
  if (!words.path.empty()) {
    const auto path = std::make_shared<CameraPath>(CameraPath::fromFile(words.path));
    const double step = frames > 1 ? (path->end() - path->begin()) / static_cast<double>(frames - 1) : 0;
    return {frames, [=](uint64_t frame) {
              return path->at(frame + 1 == frames && frames > 1
                                  ? path->end()
                                  : path->begin() + step * static_cast<double>(frame));
            }};
  }
  Camera first = placedCamera(words, lower, upper, size);
  if (!words.orbit) return {1, [=](uint64_t) { return first; }};
  const double degrees = parseNumber("--orbit", *words.orbit);
  const auto turn = [=](uint64_t frame) {
    return degrees * static_cast<double>(frame) / static_cast<double>(frames);
  };
  if (!words.parallel_scale && first.projection == Projection::kOrthographic)
    for (uint64_t frame = 0; frame < frames; ++frame)  // all of the data in every frame, and no zooming
      first.parallel_scale =
          std::max(first.parallel_scale, orbited(first, turn(frame)).parallelScaleFor(lower, upper, size));
  return {frames, [=](uint64_t frame) { return orbited(first, turn(frame)); }};
}

}  // namespace curvisplat
