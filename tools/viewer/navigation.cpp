#include "tools/viewer/navigation.h"

#include <GLFW/glfw3.h>
#include <imgui.h>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include "render/camera/camera_path.h"

namespace curvisplat {
namespace {

constexpr double kDegreesAcross = 200;  // VTK's trackball camera

glm::dvec3 turned(const glm::dvec3& vector, double degrees, const glm::dvec3& axis) {
  return glm::dvec3(glm::rotate(glm::dmat4(1), glm::radians(degrees), axis) * glm::dvec4(vector, 0));
}

double distanceOf(const Camera& camera) {
  return glm::length(camera.focal_point - camera.position);
}

double halfAngleTangent(const Camera& camera) {
  return std::tan(glm::radians(camera.view_angle_deg) / 2);
}

}  // namespace

double unitsPerPixel(const Camera& camera, ImageSize size) {
  const double half_height = camera.projection == Projection::kOrthographic
                                 ? camera.parallel_scale
                                 : distanceOf(camera) * halfAngleTangent(camera);
  return 2 * half_height / size.height;
}

Camera rotated(const Camera& camera, const glm::dvec2& movement, ImageSize size) {
  const ViewAxes axes = camera.axes();
  const double about_up = -kDegreesAcross * movement.x / size.width;
  const double about_right = -kDegreesAcross * movement.y / size.height;
  const glm::dvec3 right = turned(axes.right, about_up, axes.up);
  Camera result = camera;
  const glm::dvec3 away = turned(camera.position - camera.focal_point, about_up, axes.up);
  result.position = camera.focal_point + turned(away, about_right, right);
  result.view_up = turned(axes.up, about_right, right);
  return result;
}

Camera panned(const Camera& camera, const glm::dvec2& movement, ImageSize size) {
  const ViewAxes axes = camera.axes();
  const double unit = unitsPerPixel(camera, size);
  const glm::dvec3 shift = unit * (movement.y * axes.up - movement.x * axes.right);
  Camera result = camera;
  result.position += shift;
  result.focal_point += shift;
  return result;
}

bool isSameView(const Camera& a, const Camera& b) {
  return a.position == b.position && a.focal_point == b.focal_point && a.view_up == b.view_up &&
         a.projection == b.projection && a.parallel_scale == b.parallel_scale &&
         a.view_angle_deg == b.view_angle_deg;
}

Camera zoomed(const Camera& camera, double factor) {
  Camera result = camera;
  if (camera.projection == Projection::kOrthographic)
    result.parallel_scale /= factor;
  else
    result.position = camera.focal_point + (camera.position - camera.focal_point) / factor;
  return result;
}

Camera zoomedAt(const Camera& camera, double factor, const glm::dvec2& pixel, ImageSize size) {
  const glm::dvec2 from_middle = pixel - 0.5 * glm::dvec2(size.width, size.height);
  return panned(zoomed(camera, factor), (1 - factor) * from_middle, size);
}

Camera looking(const Camera& camera, const glm::dvec2& movement, ImageSize size) {
  const ViewAxes axes = camera.axes();
  const double degrees_per_pixel = camera.view_angle_deg / size.height;
  const double about_up = -degrees_per_pixel * movement.x, about_right = -degrees_per_pixel * movement.y;
  const glm::dvec3 right = turned(axes.right, about_up, axes.up);
  Camera result = camera;
  const glm::dvec3 ahead = turned(camera.focal_point - camera.position, about_up, axes.up);
  result.focal_point = camera.position + turned(ahead, about_right, right);
  result.view_up = turned(axes.up, about_right, right);
  return result;
}

Camera flown(const Camera& camera, const glm::dvec3& step) {
  const ViewAxes axes = camera.axes();
  const glm::dvec3 shift = step.x * axes.right + step.y * axes.up + step.z * axes.forward;
  Camera result = camera;
  result.position += shift;
  result.focal_point += shift;
  return result;
}

Camera withOtherProjection(const Camera& camera) {
  Camera result = camera;
  const double tangent = halfAngleTangent(camera);
  if (camera.projection == Projection::kOrthographic) {
    const glm::dvec3 towards_viewer = -camera.axes().forward;
    result.projection = Projection::kPerspective;
    result.position = camera.focal_point + camera.parallel_scale / tangent * towards_viewer;
  } else {
    result.projection = Projection::kOrthographic;
    result.parallel_scale = distanceOf(camera) * tangent;
  }
  return result;
}

Camera holding(const Camera& camera, ImageSize from, ImageSize to) {
  const auto aspect = [](ImageSize size) { return static_cast<double>(size.width) / size.height; };
  const double factor = std::max(1.0, aspect(from) / aspect(to));  // a narrower one has to be higher
  Camera result = camera;
  result.parallel_scale *= factor;
  result.view_angle_deg = glm::degrees(2 * std::atan(factor * halfAngleTangent(camera)));
  return result;
}

Camera refitted(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) {
  const ViewAxes axes = camera.axes();
  const double radius = std::max(glm::length(upper - lower) / 2, 1e-300);
  const double narrower = std::min(1.0, static_cast<double>(size.width) / size.height);
  const double half_angle = std::atan(halfAngleTangent(camera) * narrower);
  Camera result = camera;
  result.focal_point = 0.5 * (lower + upper);
  result.position = result.focal_point - radius / std::sin(half_angle) * axes.forward;
  result.view_up = axes.up;
  result.parallel_scale = result.parallelScaleFor(lower, upper, size);
  return result;
}

namespace {

/// How many times as far away the camera has to be to show the whole box.
double neededDistance(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper,
                      ImageSize size) {
  const ViewAxes axes = camera.axes();
  const bool perspective = camera.projection == Projection::kPerspective;
  const double half_height = perspective ? halfAngleTangent(camera) : camera.parallel_scale;
  const double half_width = half_height * size.width / size.height;
  double needed = 0;
  for (unsigned n = 0; n < 8; ++n) {
    const glm::dvec3 corner(n & 1 ? upper.x : lower.x, n & 2 ? upper.y : lower.y, n & 4 ? upper.z : lower.z);
    const glm::dvec3 from = corner - camera.focal_point;
    const double reach = std::max(std::abs(glm::dot(from, axes.right)) / half_width,
                                  std::abs(glm::dot(from, axes.up)) / half_height);
    needed =
        std::max(needed, perspective ? (reach - glm::dot(from, axes.forward)) / distanceOf(camera) : reach);
  }
  return needed;
}

}  // namespace

Camera heldOnceAround(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper,
                      ImageSize size) {
  constexpr double kDetail = 2, kStepDegrees = 4, kMargin = 1.02;
  const double now = neededDistance(camera, lower, upper, size);
  if (now > kDetail) return camera;
  double most = now;
  for (double degrees = kStepDegrees; degrees < 360; degrees += kStepDegrees)
    most = std::max(most, neededDistance(orbited(camera, degrees), lower, upper, size));
  return zoomed(camera, std::min(1.0, std::max(1.0, now) / (kMargin * most)));
}

namespace {

constexpr double kRestAfterSeconds = 0.2;        // no movement for this time
constexpr double kWheelFactor = 1.1;             // per notch
constexpr double kDragFactor = 1.01;             // per pixel
constexpr double kTurnDegrees = 15;              // per key, for turning and rolling
constexpr double kZoomFactor = 1.2;              // per key
constexpr double kWheelFlight = 0.02;            // in diagonals of the data per notch
constexpr double kFlightDiagonalsSeconds = 0.2;  // in diagonals of the data per second

}  // namespace

bool Navigation::isMoving() const {
  return holds_ || (moved_at_s_ >= 0 && ImGui::GetTime() - moved_at_s_ < kRestAfterSeconds);
}

bool Navigation::update(Window& window, Camera& camera, ImageSize size) {
  flies_ = flies_ && camera.projection == Projection::kPerspective;  // another camera may have been chosen
  const bool moved = drag(window, camera, size) | (flies_ && fly(window, camera));
  if (moved) moved_at_s_ = ImGui::GetTime();
  return moved;
}

bool Navigation::drag(Window& window, Camera& camera, ImageSize size) {
  bool moved = false;
  if (const double notches = window.takeWheel(); notches != 0) {
    if (flies_)
      camera = flown(camera, {0, 0, notches * kWheelFlight * glm::length(upper_ - lower_)});
    else
      camera = zoomedAt(camera, std::pow(kWheelFactor, notches), window.mouseInPicture(), size);
    moved = true;
  }
  for (const Window::Drag& drag : window.takeDrags()) {
    if (drag.button == GLFW_MOUSE_BUTTON_MIDDLE || (drag.button == GLFW_MOUSE_BUTTON_LEFT && drag.shift))
      camera = panned(camera, drag.movement, size);
    else if (drag.button == GLFW_MOUSE_BUTTON_RIGHT)
      camera = zoomed(camera, std::pow(kDragFactor, -drag.movement.y));
    else if (drag.button == GLFW_MOUSE_BUTTON_LEFT)
      camera = flies_ ? looking(camera, drag.movement, size) : rotated(camera, drag.movement, size);
    moved = true;
  }
  holds_ = window.isDragging();
  return moved;
}

bool Navigation::fly(const Window& window, Camera& camera) {
  const auto towards = [&](int plus, int minus) {
    return static_cast<double>(window.isDown(plus)) - static_cast<double>(window.isDown(minus));
  };
  const glm::dvec3 direction(towards(GLFW_KEY_D, GLFW_KEY_A), towards(GLFW_KEY_E, GLFW_KEY_Q),
                             towards(GLFW_KEY_W, GLFW_KEY_S));
  if (direction == glm::dvec3(0.0)) return false;
  const double passed_s = std::min(0.1, static_cast<double>(ImGui::GetIO().DeltaTime));
  camera = flown(camera, passed_s * kFlightDiagonalsSeconds * glm::length(upper_ - lower_) * direction);
  return true;
}

bool Navigation::run(Command command, Camera& camera, ImageSize size) {
  static constexpr std::pair<Command, const char*> kLooks[] = {
      {Command::kLookPlusX, "+x"},     {Command::kLookMinusX, "-x"}, {Command::kLookPlusY, "+y"},
      {Command::kLookMinusY, "-y"},    {Command::kLookPlusZ, "+z"},  {Command::kLookMinusZ, "-z"},
      {Command::kLookIsometric, "iso"}};
  for (const auto& [look, from] : kLooks) {
    if (look != command) continue;
    camera = Camera::named(from, lower_, upper_, size, camera.projection, camera.view_angle_deg);
    return true;
  }
  switch (command) {
    case Command::kTurnRight:
    case Command::kTurnLeft:
      camera = orbited(camera, command == Command::kTurnRight ? kTurnDegrees : -kTurnDegrees);
      return true;
    case Command::kTurnUp:
    case Command::kTurnDown:
      camera = elevated(camera, command == Command::kTurnUp ? kTurnDegrees : -kTurnDegrees);
      return true;
    case Command::kRollLeft:
    case Command::kRollRight:
      camera = rolled(camera, command == Command::kRollLeft ? kTurnDegrees : -kTurnDegrees);
      return true;
    case Command::kZoomIn:
      camera = zoomed(camera, kZoomFactor);
      return true;
    case Command::kZoomOut:
      camera = zoomed(camera, 1 / kZoomFactor);
      return true;
    case Command::kFit:
      camera = refitted(camera, lower_, upper_, size);
      return true;
    case Command::kOtherProjection:
      camera = withOtherProjection(camera);
      return true;
    case Command::kFly:
      flies_ = !flies_;
      if (flies_ && camera.projection == Projection::kOrthographic) camera = withOtherProjection(camera);
      return true;
    default:
      return false;
  }
}

}  // namespace curvisplat
