// Moves the camera as in ParaView: Navigation applies the mouse and commands, and pure functions do the
// movements.
//
//   left drag                   rotate
//   middle or shift+left drag   pan
//   wheel                       zoom; what is under the mouse stays there
//   right drag                  zoom
//   arrows                      turn, as --azimuth and --elevation; with shift roll and zoom
//   flying: w s forwards and backwards, a d left and right, q e down and up, left drag looks around
//
// `movement` is in pixels of a window of `size`, x to the right, y down. The functions return the moved
// camera, on any thread; a Navigation is for the window's thread.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/camera/camera.h"
#include "tools/window/window_commands.h"

namespace curvisplat {

/// Rotates around the focal point: moving across the window's width turns by 200 degrees about the image's
/// up direction, across its height by 200 degrees about the image's right.
Camera rotated(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Moves parallel to the image; points at the focal point's depth follow the mouse.
Camera panned(const Camera& camera, const glm::dvec2& movement, ImageSize size);
bool isSameView(const Camera& a, const Camera& b);
/// Magnifies objects at the focal point's depth by `factor` > 0; a perspective camera moves towards the
/// point.
Camera zoomed(const Camera& camera, double factor);
/// Zooms so that what is seen at `pixel` at the focal point's depth stays there.
Camera zoomedAt(const Camera& camera, double factor, const glm::dvec2& pixel, ImageSize size);
/// Turns the camera in place; moving across the window's height turns by the view angle.
Camera looking(const Camera& camera, const glm::dvec2& movement, ImageSize size);
/// Moves camera and focal point by `step` in world units: x to the right, y up, z forward.
Camera flown(const Camera& camera, const glm::dvec3& step);

/// Switches the projection and keeps the size of objects at the focal point's depth.
Camera withOtherProjection(const Camera& camera);
/// The camera at which a picture of the size `to` shows all that one of the size `from` shows.
Camera holding(const Camera& camera, ImageSize from, ImageSize to);
/// Keeps the view direction and fits the box [lower, upper] into the image.
Camera refitted(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

/// The camera for a movie once around it: where this one shows the box [lower, upper] whole, that one does so from all sides.
/// Where a part lies beyond the picture's sides, at most as much of it does so from others; a small detail stays as large.
Camera heldOnceAround(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

/// World units per pixel at the focal point's depth.
double unitsPerPixel(const Camera& camera, ImageSize size);

/// The camera's mode and what moves it.
class Navigation {
 public:
  /// Sets the box, after --scale, that `r`, `x`, `y` and `z` fit into the window.
  void setBounds(const glm::dvec3& lower, const glm::dvec3& upper) { lower_ = lower, upper_ = upper; }

  /// Applies the input since the last frame of Dear ImGui. Returns true if the camera moved. Call within a
  /// frame.
  bool update(Window& window, Camera& camera, ImageSize size);
  /// Returns true if the command moved the camera or changed its mode.
  bool run(Command command, Camera& camera, ImageSize size);

  /// heldOnceAround() of the box.
  Camera onceAround(const Camera& camera, ImageSize size) const {
    return heldOnceAround(camera, lower_, upper_, size);
  }

  /// Whether the camera moves or moved less than 0.2 s ago, so that a coarse picture suffices.
  bool isMoving() const;
  bool flies() const { return flies_; }
  /// The left drag rotates again.
  void endFlight() { flies_ = false; }

 private:
  bool drag(Window& window, Camera& camera, ImageSize size);
  bool fly(const Window& window, Camera& camera);

  glm::dvec3 lower_{0.0}, upper_{1.0};
  bool flies_ = false;
  bool holds_ = false;      // a mouse button is down
  double moved_at_s_ = -1;  // by Dear ImGui's clock
};

}  // namespace curvisplat
