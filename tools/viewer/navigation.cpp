#include "tools/viewer/navigation.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "tools/viewer/camera_controls.h"

namespace curvisplat {
namespace {

constexpr double kRestAfterSeconds = 0.2;        // no movement for this time
constexpr double kWheelFactor = 1.1;             // per notch
constexpr double kDragFactor = 1.01;             // per pixel
constexpr double kWheelFlight = 0.02;            // in diagonals of the data per notch
constexpr double kFlightDiagonalsSeconds = 0.2;  // in diagonals of the data per second

}  // namespace

bool Navigation::isMoving() const {
  return holds_ || (moved_at_s_ >= 0 && ImGui::GetTime() - moved_at_s_ < kRestAfterSeconds);
}

bool Navigation::update(Window& window, Camera& camera, ImageSize size) {
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
  const auto look = [&](const char* from) {
    camera = Camera::named(from, lower_, upper_, size, camera.projection, camera.view_angle_deg);
    return true;
  };
  switch (command) {
    case Command::kFit:
      camera = refitted(camera, lower_, upper_, size);
      return true;
    case Command::kLookPlusX:
      return look("+x");
    case Command::kLookMinusX:
      return look("-x");
    case Command::kLookPlusY:
      return look("+y");
    case Command::kLookMinusY:
      return look("-y");
    case Command::kLookPlusZ:
      return look("+z");
    case Command::kLookMinusZ:
      return look("-z");
    case Command::kOtherProjection:
      camera = withOtherProjection(camera);
      flies_ = flies_ && camera.projection == Projection::kPerspective;
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
