// Applies mouse and commands to the camera, as in ParaView:
//
//   left drag                   rotate
//   middle or shift+left drag   pan
//   wheel                       zoom; what is under the mouse stays there
//   right drag                  zoom
//   flying: w s forwards and backwards, a d left and right, q e down and up, left drag looks around
#pragma once

#include <glm/vec3.hpp>

#include "render/camera/camera.h"
#include "tools/viewer/window_commands.h"

namespace curvisplat {

class Navigation {
 public:
  /// Sets the data's bounding box, after --scale, which `r`, `x`, `y` and `z` fit into the window.
  void setBounds(const glm::dvec3& lower, const glm::dvec3& upper) { lower_ = lower, upper_ = upper; }

  /// Applies the input since the last frame of Dear ImGui. Returns true if the camera moved. Call within a
  /// frame.
  bool update(Window& window, Camera& camera, ImageSize size);
  /// Returns true if the command moved the camera or changed its mode.
  bool run(Command command, Camera& camera, ImageSize size);

  /// Whether the camera moves or moved less than 0.2 s ago, so that a coarse picture suffices.
  bool isMoving() const;
  bool flies() const { return flies_; }

 private:
  bool drag(Window& window, Camera& camera, ImageSize size);
  bool fly(const Window& window, Camera& camera);

  glm::dvec3 lower_{0.0}, upper_{1.0};
  bool flies_ = false;
  bool holds_ = false;      // a mouse button is down
  double moved_at_s_ = -1;  // by Dear ImGui's clock
};

}  // namespace curvisplat
